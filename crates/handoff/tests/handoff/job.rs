//! The drafts of the job, read as the writer's compiler would: statement by statement, nothing left over.

use std::collections::BTreeMap;
use std::fs;

use metalith_core::{Result, Silent};
use metalith_design::Design;
use metalith_gds::{LayerNumber, Layout, Selection, Shape, Transform, Visitor};

use crate::{DESIGN, PILLARS, Squares, rows, shared};

/// Layer of the crosses of the first step.
const MARKS: LayerNumber = LayerNumber { layer: 3, datatype: 0 };
/// Names of job decks and schedules without their endings, with their currents (nA).
const JOBS: [(&str, f64); 3] = [("mini_3x3_0p5nA", 0.5), ("mini_3x3_2nA", 2.0), ("mini_3x3_8nA", 8.0)];

/// Places in jobs have three decimals: half a nanometre (um).
const HALF_NM_UM: f64 = 5e-4;

type Place = (f64, f64);

/// Contents of a job deck. Places are on the substrate or from the middle of a chip (um).
#[derive(Debug, Default)]
struct Deck {
    name: String,
    diameter_inch: f64,
    global: BTreeMap<String, Place>,
    arm_um: Vec<f64>,
    /// Middles of the chips of the array.
    chips: Vec<Place>,
    chip_marks: BTreeMap<String, Place>,
    /// Pattern and dose table of all chips.
    assigned: Vec<(usize, String)>,
    layer: u32,
    patterns: BTreeMap<usize, String>,
    current_na: f64,
    /// Change of dose of each rank (%).
    shots: BTreeMap<String, BTreeMap<u32, f64>>,
}

/// Statements without comments and blanks. Lines end as the writer's computer and a PC take them.
fn statements(text: &str) -> Vec<String> {
    assert!(text.is_ascii() && text.ends_with("END\r\n"));
    let bare = |line: &str| line.split(';').next().unwrap().trim().to_owned();
    text.split("\r\n").map(bare).filter(|s| !s.is_empty()).collect()
}

fn quoted(text: &str) -> String {
    let name = text.trim().strip_prefix('\'').and_then(|t| t.strip_suffix('\''));
    name.unwrap_or_else(|| panic!("{text} is not in quotes")).to_owned()
}

/// `(1,2,3)` as numbers.
fn numbers(text: &str) -> Vec<f64> {
    let inner = text.trim().strip_prefix('(').and_then(|t| t.strip_suffix(')'));
    let inner = inner.unwrap_or_else(|| panic!("{text} is not in brackets"));
    inner.split(',').map(|n| n.parse().unwrap()).collect()
}

/// `P=(1,2),Q=(3,4)` as names with places.
fn places(text: &str) -> BTreeMap<String, Place> {
    text.split_inclusive(')')
        .map(|part| {
            let (name, place) = part.trim_start_matches(',').split_once('=').unwrap();
            let xy = numbers(place);
            assert_eq!(xy.len(), 2, "{part}");
            (name.to_owned(), (xy[0], xy[1]))
        })
        .collect()
}

impl Deck {
    /// Read a deck whose statements are in the order that the compiler asks for.
    fn read(text: &str) -> Self {
        const ORDER: [&str; 14] = [
            "JOB/W", "GLMPOS", "GLMP", "PATH", "ARRAY", "CHMPOS", "ASSIGN", "AEND", "PEND", "LAYER", "P", "STDCUR",
            "SHOT", "END",
        ];
        let mut deck = Self::default();
        let mut reached = 0;
        for statement in statements(text) {
            let (word, rest) = statement.split_once(' ').unwrap_or((&statement, ""));
            let kind = match word {
                w if w.starts_with("P(") => "P",
                w if w.starts_with("SHOT") => "SHOT",
                w => w,
            };
            let at = ORDER
                .iter()
                .position(|k| *k == kind)
                .unwrap_or_else(|| panic!("unknown: {statement}"));
            assert!(at >= reached, "{statement} comes too late");
            reached = at;
            deck.take(kind, word, rest.trim());
        }
        assert_eq!(ORDER[reached], "END");
        deck
    }

    fn take(&mut self, kind: &str, word: &str, rest: &str) {
        match kind {
            "JOB/W" => {
                let (name, size) = rest.split_once(',').unwrap();
                (self.name, self.diameter_inch) = (quoted(name), size.parse().unwrap());
            }
            "GLMPOS" => self.global = places(rest),
            "GLMP" => self.arm_um = rest.split(',').map(|n| n.parse().unwrap()).collect(),
            "ARRAY" => {
                let (x, y) = rest.split_once(")/(").unwrap();
                let (x, y) = (numbers(&format!("{x})")), numbers(&format!("({y}")));
                // Columns to the right, rows downwards.
                for row in 0..y[1] as usize {
                    let line = (0..x[1] as usize).map(|k| (x[0] + k as f64 * x[2], y[0] - row as f64 * y[2]));
                    self.chips.extend(line);
                }
            }
            "CHMPOS" => self.chip_marks = places(rest),
            "ASSIGN" => {
                let (pattern, to) = rest.split_once(" -> ").unwrap();
                let shot = to.strip_prefix("((*,*),").and_then(|t| t.strip_suffix(')')).unwrap();
                self.assigned.push((number_of(pattern), shot.to_owned()));
            }
            "LAYER" => self.layer = rest.parse().unwrap(),
            "P" => drop(self.patterns.insert(number_of(word), quoted(rest))),
            "STDCUR" => self.current_na = rest.parse().unwrap(),
            "SHOT" => {
                let table = rest
                    .strip_prefix("MODULAT (")
                    .and_then(|t| t.strip_suffix(')'))
                    .unwrap();
                let ranks = table.split_inclusive(')').map(|pair| {
                    let pair = numbers(pair.trim_start_matches(','));
                    (pair[0] as u32, pair[1])
                });
                self.shots
                    .insert(word.trim_end_matches(':').to_owned(), ranks.collect());
            }
            _ => assert!(rest.is_empty() || kind == "PATH", "{word} {rest}"),
        }
    }
}

/// 1 of `P(1)`.
fn number_of(pattern: &str) -> usize {
    numbers(pattern.strip_prefix('P').unwrap())[0] as usize
}

fn deck(stem: &str) -> Deck {
    let text = fs::read_to_string(shared().join(format!("job/{stem}.jdf"))).unwrap();
    assert!(text.starts_with("; DRAFT"));
    Deck::read(&text)
}

#[test]
fn decks_name_what_is_there() {
    let doses = rows("dose/dose_table.csv");
    for (stem, current_na) in JOBS {
        let deck = deck(stem);
        assert_eq!(
            (deck.name.as_str(), deck.diameter_inch, deck.current_na),
            ("MINI3X3", 4.0, current_na)
        );
        assert!(
            deck.assigned
                .iter()
                .all(|(p, shot)| deck.patterns.contains_key(p) && deck.shots.contains_key(shot))
        );
        for pattern in deck.patterns.values() {
            let gds = format!("{}.gds", pattern.strip_suffix(".v30").unwrap());
            let there = ["layout", "dose", "tests"].map(|folder| shared().join(folder).join(&gds).is_file());
            assert_eq!(there.iter().filter(|t| **t).count(), 1, "{gds}");
        }
        assert_eq!(deck.shots["SHOT1"], BTreeMap::from([(0, 0.0)]));
        // The rank is the datatype of the matrix; the change is that of its table, to a tenth of a per cent.
        assert_eq!(deck.shots["SHOT2"].len(), doses.len());
        for dose in &doses {
            let (rank, asked): (u32, f64) = (dose["number"].parse().unwrap(), dose["dose_uc_cm2"].parse().unwrap());
            assert!((280.0 * (1.0 + deck.shots["SHOT2"][&rank] / 100.0) - asked).abs() < 280.0 * 0.0005 + 0.005);
        }
    }
}

#[test]
fn schedules_lead_to_their_decks() {
    for (stem, _) in JOBS {
        let text = fs::read_to_string(shared().join(format!("job/{stem}.sdf"))).unwrap();
        let statements = statements(&text);
        let words: Vec<_> = statements
            .iter()
            .map(|s| s.split([' ', ',', '(']).next().unwrap())
            .collect();
        assert_eq!(
            words,
            [
                "MAGAZIN", "#1", "%4A", "JDF", "ACC", "DEFMODE", "RESIST", "SHOT", "OFFSET", "END"
            ]
        );
        let (file, layer) = statements[3].strip_prefix("JDF ").unwrap().split_once(',').unwrap();
        let deck = deck(&quoted(file));
        assert_eq!((quoted(file).as_str(), layer.parse()), (stem, Ok(deck.layer)));
        assert_eq!(quoted(statements[0].strip_prefix("MAGAZIN ").unwrap()), deck.name);
        // Shots a grid unit or an even number of them apart, at a rate that the writer has.
        let step: f64 = statements[7].strip_prefix("SHOT A,").unwrap().parse().unwrap();
        assert!(step == 1.0 || step % 2.0 == 0.0);
        let clock_mhz = 100.0 * deck.current_na * 1e3 / (280.0 * step * step);
        assert!(clock_mhz <= 50.0, "{clock_mhz} MHz");
    }
}

/// Boxes of the crosses (um): middle and length.
#[derive(Default)]
struct Crosses(Vec<(Place, f64)>);

impl Visitor for Crosses {
    fn shape(&mut self, shape: &Shape<'_>, placements: &[Transform]) -> Result<()> {
        for placement in placements {
            let points = shape.outline.placed(placement).into_iter();
            let (mut x, mut y): (Vec<_>, Vec<_>) = points.map(|p| (p.x, p.y)).unzip();
            x.sort_unstable();
            y.sort_unstable();
            let um = |v: i64| v as f64 * 1e-3;
            let (left, right, bottom, top) = (x[0], x[x.len() - 1], y[0], y[y.len() - 1]);
            self.0
                .push(((um(left + right) / 2.0, um(bottom + top) / 2.0), um(right - left)));
        }
        Ok(())
    }
}

fn visit<V: Visitor>(file: &str, layer: LayerNumber, visitor: &mut V) {
    let selection = Selection {
        layers: Some(vec![layer]),
        ..Selection::default()
    };
    let layout = Layout::open(&shared().join(file)).unwrap();
    layout.visit(&selection, visitor, &Silent).unwrap();
}

/// Places from the job to the glass: a pattern has its middle on the middle of its chip. Where the crosses and the
/// lenses of the file land is where the alignment table and the design have them.
#[test]
fn what_the_job_places_lands_where_the_tables_say() {
    let pillars_file = "layout/mini_3x3_pillars.gds";
    let mut crosses = Crosses::default();
    visit(pillars_file, MARKS, &mut crosses);
    let mut squares = Squares::default();
    visit(pillars_file, PILLARS, &mut squares);
    // The middle of all that is exposed, which the conversion makes the origin of the pattern.
    let ends = |v: &mut dyn Iterator<Item = f64>| v.fold((f64::MAX, f64::MIN), |(a, b), v| (a.min(v), b.max(v)));
    let along = |pick: fn(&Place) -> f64| {
        let (low, high) = ends(
            &mut crosses
                .0
                .iter()
                .flat_map(|(at, l)| [pick(at) - l / 2.0, pick(at) + l / 2.0]),
        );
        (low + high) / 2.0
    };
    let middle = (along(|p| p.0), along(|p| p.1));
    let deck = deck("mini_3x3_2nA");
    assert_eq!(deck.assigned[0].0, 1);
    assert!(pillars_file.ends_with(&deck.patterns[&1].replace(".v30", ".gds")));
    assert_eq!(deck.chips, [(0.0, 0.0)]);
    let chip = deck.chips[0];
    let land = |(x, y): Place| (chip.0 + x - middle.0, chip.1 + y - middle.1);
    let near = |a: Place, b: Place| (a.0 - b.0).abs() < HALF_NM_UM && (a.1 - b.1).abs() < HALF_NM_UM;

    let table = rows("metrology/alignment.csv");
    assert_eq!(table.len(), crosses.0.len());
    let mut named = 0;
    for row in &table {
        let number = |key: &str| row[key].parse::<f64>().unwrap();
        let at = (number("x_um"), number("y_um"));
        let cross = crosses.0.iter().find(|(place, _)| near(land(*place), at));
        assert_eq!(
            cross.unwrap_or_else(|| panic!("no cross at {at:?}")).1,
            number("arm_length_um")
        );
        let role = row["role"].as_str();
        let in_job = match role.chars().next() {
            Some('P' | 'Q') => deck.global[role],
            Some('M') => (chip.0 + deck.chip_marks[role].0, chip.1 + deck.chip_marks[role].1),
            _ => continue,
        };
        assert!(near(in_job, at), "{role}");
        if role == "P" {
            assert_eq!(deck.arm_um[..2], [number("arm_width_um"), number("arm_length_um")]);
        }
        named += 1;
    }
    assert_eq!(named, deck.global.len() + deck.chip_marks.len());

    let design = Design::read(std::path::Path::new(DESIGN)).unwrap();
    let radius_um = design.lens.radius_um();
    for element in design.elements() {
        let (x, y) = (element.centre_nm.0 as f64 * 1e-3, element.centre_nm.1 as f64 * 1e-3);
        let places = squares
            .found
            .keys()
            .map(|&(x, y)| land((x as f64 * 5e-4, y as f64 * 5e-4)));
        let own: Vec<_> = places.filter(|p| (p.0 - x).hypot(p.1 - y) <= radius_um).collect();
        let (left, right) = ends(&mut own.iter().map(|p| p.0));
        let (bottom, top) = ends(&mut own.iter().map(|p| p.1));
        assert!(own.len() > 20_000 && near(((left + right) / 2.0, (bottom + top) / 2.0), (x, y)));
    }
}
