//! Open lines that meet end to end, joined to closed outlines.

use std::collections::HashMap;

/// A line of corners on the grid, and the line of the file where it stands.
pub(super) struct Chain {
    pub points: Vec<[i32; 2]>,
    pub line: u64,
}

/// Ends at one place that are too many to tell which belong together.
const MANY: usize = 5;

/// Closed outlines of chains whose ends meet in pairs, to within one step of the grid, and the chains that close none.
pub(super) fn closed(chains: Vec<Chain>) -> (Vec<Vec<[i32; 2]>>, Vec<Chain>) {
    let mut ends: HashMap<[i32; 2], Vec<(usize, bool)>> = HashMap::new();
    for (k, chain) in chains.iter().enumerate() {
        ends.entry(chain.points[0]).or_default().push((k, false));
        ends.entry(chain.points[chain.points.len() - 1])
            .or_default()
            .push((k, true));
    }
    let mut used = vec![false; chains.len()];
    let (mut outlines, mut open) = (Vec::new(), Vec::new());
    for first in 0..chains.len() {
        if used[first] {
            continue;
        }
        let start = chains[first].points[0];
        let (mut outline, mut members) = (Vec::new(), Vec::new());
        let (mut at, mut backwards) = (first, false);
        let is_closed = loop {
            used[at] = true;
            members.push(at);
            let own = &chains[at].points;
            let end = if backwards {
                outline.extend(own.iter().rev());
                own[0]
            } else {
                outline.extend(own);
                own[own.len() - 1]
            };
            if near(end, start) {
                break true;
            }
            // Two ends meet: the one of this chain, and one more. Where there are many, which belong together is not known.
            let meeting: Vec<_> = around(end)
                .filter_map(|place| ends.get(&place))
                .flatten()
                .take(MANY)
                .collect();
            let mut others = meeting.iter().filter(|(k, _)| meeting.len() < MANY && !used[*k]);
            match (others.next(), others.next()) {
                (Some(&&(next, from_end)), None) => (at, backwards) = (next, from_end),
                _ => break false,
            }
        };
        if is_closed && outline.len() > 2 {
            outlines.push(outline);
        } else {
            open.extend(members);
        }
    }
    let mut chains: Vec<Option<Chain>> = chains.into_iter().map(Some).collect();
    let open = open.into_iter().filter_map(|k| chains[k].take()).collect();
    (outlines, open)
}

fn near(a: [i32; 2], b: [i32; 2]) -> bool {
    (0..2).all(|k| (i64::from(a[k]) - i64::from(b[k])).abs() <= 1)
}

/// The place and its eight neighbours.
fn around([x, y]: [i32; 2]) -> impl Iterator<Item = [i32; 2]> {
    let beside = |v: i32| [v.saturating_sub(1), v, v.saturating_add(1)];
    beside(x).into_iter().flat_map(move |x| beside(y).map(|y| [x, y]))
}

#[cfg(test)]
mod tests {
    use super::*;

    fn chain(points: &[[i32; 2]]) -> Chain {
        Chain {
            points: points.to_vec(),
            line: 0,
        }
    }

    #[test]
    fn ends_that_meet_close_outlines() {
        let chains = vec![
            chain(&[[0, 0], [10, 0]]),
            chain(&[[10, 10], [10, 1]]),
            chain(&[[10, 10], [0, 10], [0, 1]]),
            chain(&[[50, 0], [60, 0]]),
            chain(&[[60, 0], [60, 9]]),
        ];
        let (outlines, open) = closed(chains);
        assert_eq!(
            outlines,
            [vec![[0, 0], [10, 0], [10, 1], [10, 10], [10, 10], [0, 10], [0, 1]]]
        );
        assert_eq!(open.len(), 2);
        // Three ends at one place say nothing.
        let fork = [[10, 0], [5, 9], [0, 0]].map(|to| chain(&[[3, 3], to]));
        assert_eq!(closed(fork.into()).1.len(), 3);
    }
}
