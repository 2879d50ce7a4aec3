//! Kernels of nodes as they are found, which are stored before all are there: an interrupted run loses the work of half a
//! minute at most.

use std::sync::{Mutex, MutexGuard, PoisonError};
use std::time::{Duration, Instant};

use metalith_core::cpu_time::{cpu_seconds, since};
use metalith_core::{Progress, Result};

use super::bank::BankSpec;
use crate::kernel_parts::{KernelParts, NodeId};

/// Longest time between two parts that are stored.
pub(super) const BETWEEN_PARTS: Duration = Duration::from_secs(30);
/// CPU time of the first share of the work (s), from which the time of the whole is estimated: hundredths of a second are counted.
const FIRST_SHARE_S: f64 = 3.0;
/// Least CPU time of all kernels that is stated before (s).
const LONG_S: f64 = 60.0;

/// Kernels of one unique node of a distinct element.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct NodeKernels {
    /// Channel, spectrum, then rows of the kernel.
    pub(crate) values: Vec<f32>,
    /// Share of the light of each wavelength that lands in the window of its own chief ray.
    pub(crate) in_window: Vec<f32>,
}

/// Kernels of the nodes that were found so far.
pub(super) struct FoundNodes<'a> {
    parts: &'a KernelParts<'a>,
    spec: &'a BankSpec,
    wavelengths: usize,
    state: Mutex<State>,
}

struct State {
    /// Kernels by distinct element and unique node.
    found: Vec<Vec<Option<NodeKernels>>>,
    /// Nodes that no part holds yet.
    fresh: Vec<NodeId>,
    stored: Instant,
    /// Nodes that this run is to find, and those that it has found.
    wanted: usize,
    done: usize,
    /// Wavelengths of nodes that were simulated; nodes that are not complete count too.
    steps: usize,
    clock: Clock,
    is_told: bool,
}

/// CPU time of the work.
struct Clock {
    begun: Option<f64>,
    at: Instant,
    /// CPU time for what distinct elements transmit (s), and the number of these.
    light_s: f64,
    lit: usize,
}

impl Clock {
    /// CPU time so far (s); where the system does not tell it, as if all threads were at work.
    fn spent_s(&self) -> f64 {
        let busy = || self.at.elapsed().as_secs_f64() * rayon::current_num_threads() as f64;
        since(self.begun).unwrap_or_else(busy)
    }
}

impl<'a> FoundNodes<'a> {
    /// Nodes of distinct elements, so many of each, with the kernels that an interrupted run has stored. `sizes`: numbers of the kernels of
    /// a node, and wavelengths.
    pub(super) fn new(parts: &'a KernelParts<'a>, spec: &'a BankSpec, counts: &[usize], sizes: [usize; 2]) -> Self {
        let mut found: Vec<Vec<Option<NodeKernels>>> = counts.iter().map(|count| vec![None; *count]).collect();
        let mut wanted: usize = counts.iter().sum();
        for (id, kernels) in parts.read(spec) {
            let fits = [kernels.values.len(), kernels.in_window.len()] == sizes;
            let place = found.get_mut(id.element).and_then(|nodes| nodes.get_mut(id.node));
            if let Some(place @ None) = place.filter(|_| fits) {
                *place = Some(kernels);
                wanted -= 1;
            }
        }
        Self {
            parts,
            spec,
            wavelengths: sizes[1],
            state: Mutex::new(State {
                found,
                fresh: Vec::new(),
                stored: Instant::now(),
                wanted,
                done: 0,
                steps: 0,
                clock: Clock {
                    begun: cpu_seconds(),
                    at: Instant::now(),
                    light_s: 0.0,
                    lit: 0,
                },
                is_told: false,
            }),
        }
    }

    /// Number of nodes that are still to be found.
    pub(super) fn wanted(&self) -> usize {
        let state = self.state();
        state.wanted - state.done
    }

    /// Nodes of a distinct element that are still to be found. They are spread over its field in whatever order, so that the
    /// time of the first ones tells that of all: light of the outer ones may miss the sensor and cost nothing.
    pub(super) fn missing(&self, element: usize) -> Vec<usize> {
        let state = self.state();
        let nodes = &state.found[element];
        let step = coprime_step(nodes.len());
        let all = (0..nodes.len()).map(|k| k * step % nodes.len());
        all.filter(|node| nodes[*node].is_none()).collect()
    }

    /// Result of `light`, which is what one more distinct element transmits: it takes the same time for few nodes and for many.
    ///
    /// # Errors
    /// Errors of `light`.
    pub(super) fn timed<T>(&self, light: impl FnOnce() -> Result<T>) -> Result<T> {
        let before = self.state().clock.spent_s();
        let lit = light()?;
        let clock = &mut self.state().clock;
        clock.light_s += clock.spent_s() - before;
        clock.lit += 1;
        Ok(lit)
    }

    /// Take the kernels of a node, and store what was found if it is time to.
    ///
    /// # Errors
    /// If they cannot be stored in a folder that was asked for.
    pub(super) fn add(&self, id: NodeId, kernels: NodeKernels, progress: &dyn Progress) -> Result<()> {
        let mut state = self.state();
        state.found[id.element][id.node] = Some(kernels);
        state.fresh.push(id);
        state.done += 1;
        if state.stored.elapsed() < BETWEEN_PARTS || state.done == state.wanted {
            return Ok(());
        }
        self.store(&mut state, progress)
    }

    /// Count one wavelength of a node.
    pub(super) fn advance(&self, progress: &dyn Progress) {
        let mut state = self.state();
        state.steps += 1;
        self.tell(&mut state, progress);
        drop(state);
        progress.advance(1);
    }

    /// Store what was found since the last part.
    ///
    /// # Errors
    /// As [`FoundNodes::add`].
    pub(super) fn store_fresh(&self, progress: &dyn Progress) -> Result<()> {
        self.store(&mut self.state(), progress)
    }

    /// The kernels of all nodes, by distinct element.
    ///
    /// # Panics
    /// If one was not found.
    pub(super) fn into_all(self) -> impl Iterator<Item = Vec<NodeKernels>> {
        let state = self.state.into_inner().unwrap_or_else(PoisonError::into_inner);
        let all =
            |nodes: Vec<Option<NodeKernels>>| nodes.into_iter().map(|node| node.expect("all were found")).collect();
        state.found.into_iter().map(all)
    }

    fn store(&self, state: &mut State, progress: &dyn Progress) -> Result<()> {
        let fresh = std::mem::take(&mut state.fresh);
        let found = &state.found;
        let of = |id: &NodeId| Some((*id, found[id.element][id.node].as_ref()?));
        let nodes: Vec<_> = fresh.iter().filter_map(of).collect();
        let done = self.parts.store(self.spec, &nodes, progress);
        state.stored = Instant::now();
        done
    }

    /// Tell the CPU time of the whole once, if it is long.
    fn tell(&self, state: &mut State, progress: &dyn Progress) {
        if state.is_told {
            return;
        }
        let clock = &state.clock;
        let nodes_s = clock.spent_s() - clock.light_s;
        if nodes_s < FIRST_SHARE_S {
            return;
        }
        let share = state.steps as f64 / (state.wanted * self.wavelengths) as f64;
        let unlit = state
            .found
            .iter()
            .filter(|nodes| nodes.iter().any(Option::is_none))
            .count();
        let to_light = unlit.saturating_sub(1) as f64 / clock.lit.max(1) as f64;
        let whole_s = nodes_s / share + clock.light_s * (1.0 + to_light);
        let statement = self.parts.camera().and_then(|name| statement(name, whole_s, share));
        if let Some(statement) = statement {
            progress.warn(&statement);
        }
        state.is_told = true;
    }

    fn state(&self) -> MutexGuard<'_, State> {
        self.state.lock().unwrap_or_else(PoisonError::into_inner)
    }
}

/// Statement of the CPU time of a whole (s) that was estimated from a share of it; none of one that is not long.
fn statement(camera: &str, whole_s: f64, share: f64) -> Option<String> {
    (whole_s >= LONG_S).then(|| {
        format!(
            "the kernels of camera `{camera}` are not in the cache: about {:.0} min of CPU time, an estimate from the first {:.1} %; \
             later runs take them from the cache",
            (whole_s / 60.0).ceil(),
            100.0 * share
        )
    })
}

/// Step through so many places that meets each of them once and is about the golden share of all.
fn coprime_step(count: usize) -> usize {
    let divides = |step: usize| (2..=step).any(|d| step.is_multiple_of(d) && count.is_multiple_of(d));
    let golden = (count as f64 * 0.618) as usize;
    (golden.max(1)..).find(|step| !divides(*step)).unwrap_or(1)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn long_work_is_told_before() {
        assert_eq!(statement("a", 59.0, 0.05), None);
        let words = statement("a", 601.0, 0.005).unwrap();
        assert!(words.contains("11 min") && words.contains("0.5 %"), "{words}");
    }

    #[test]
    fn steps_meet_every_place_once() {
        for count in 1..200 {
            let step = coprime_step(count);
            let mut places: Vec<usize> = (0..count).map(|k| k * step % count).collect();
            places.sort_unstable();
            assert!(places.into_iter().eq(0..count), "{count}");
        }
    }
}
