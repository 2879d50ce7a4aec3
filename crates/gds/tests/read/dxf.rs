//! Drawings in DXF, read as layouts.

use metalith_core::Progress;
use metalith_gds::{Error, Layout, LayoutError, ReadLimits};

use super::boxes;

#[derive(Default)]
struct Hears {
    texts: std::sync::Mutex<Vec<String>>,
    strict: bool,
}

impl Progress for Hears {
    fn begin(&self, _: &str, _: u64) {}

    fn advance(&self, _: u64) {}

    fn warn(&self, text: &str) {
        self.texts.lock().unwrap().push(text.to_owned());
    }

    fn strict(&self) -> bool {
        self.strict
    }
}

/// Pairs of a drawing from words: code, value, code, value.
fn pairs(words: &str) -> String {
    words.split_whitespace().map(|word| format!("{word}\n")).collect()
}

/// A drawing of blocks and entities.
fn drawing(units: &str, blocks: &str, entities: &str) -> String {
    pairs(&format!(
        "0 SECTION 2 HEADER 9 $UCSNAME 2 NONE {units} 0 ENDSEC 0 SECTION 2 BLOCKS {blocks} 0 ENDSEC 0 SECTION 2 ENTITIES {entities} 0 ENDSEC 0 SECTION 2 OBJECTS 0 LAYOUT 8 ODD 10 1e9 0 ENDSEC 0 EOF"
    ))
}

fn read_by(text: &str, hears: &Hears) -> Result<Layout, Error> {
    let file = tempfile::NamedTempFile::new().unwrap();
    std::fs::write(file.path(), text).unwrap();
    Layout::open_with(file.path(), ReadLimits::default(), hears)
}

fn read(text: &str) -> (Layout, Vec<String>) {
    let hears = Hears::default();
    let layout = read_by(text, &hears).unwrap();
    (layout, hears.texts.into_inner().unwrap())
}

/// A closed square of three tenths.
const SQUARE: &str = "0 LWPOLYLINE 8 1 90 4 70 1 10 0 20 0 10 0.3 20 0 10 0.3 20 0.3 10 0 20 0.3";

#[test]
fn units_and_layers_are_stated() {
    let (layout, said) = read(&drawing("", "", SQUARE));
    assert_eq!((boxes(&layout), layout.unit_nm()), (vec![[0, 0, 300, 300]], 1.0));
    assert!(
        said.len() == 1 && said[0].contains("taken as 1 um") && said[0].contains("1 is 1/0"),
        "{said:?}"
    );
    let (layout, said) = read(&drawing("9 $INSUNITS 70 4", "", SQUARE));
    assert_eq!(boxes(&layout), [[0, 0, 300_000, 300_000]]);
    assert!(said[0].contains("1 mm"));
    // Metres that are no chip: the unit that some programs write whatever is drawn.
    let far = SQUARE.replace("0.3", "300");
    let (layout, said) = read(&drawing("9 $INSUNITS 70 6", "", &far));
    assert_eq!(boxes(&layout), [[0, 0, 300_000, 300_000]]);
    assert!(said[0].contains("larger than a wafer"));
    let lines = drawing("", "", SQUARE).replace('\n', "\r\n");
    assert_eq!(boxes(&read(&lines).0), [[0, 0, 300, 300]]);
}

#[test]
fn entities_are_drawn() {
    let of = |entity: &str| boxes(&read(&drawing("", "", entity)).0);
    assert_eq!(of("0 CIRCLE 8 1 10 1 20 2 40 0.15"), [[850, 1850, 1150, 2150]]);
    assert_eq!(
        of("0 ELLIPSE 8 1 10 0 20 0 11 0 21 0.2 40 0.5 41 0 42 6.283185307"),
        [[-100, -200, 100, 200]]
    );
    assert_eq!(
        of("0 SOLID 8 1 10 0 20 0 11 1 21 0 12 0 22 1 13 1 23 1"),
        [[0, 0, 1000, 1000]]
    );
    // Two half circles by bulges, counter-clockwise.
    assert_eq!(
        of("0 LWPOLYLINE 8 1 70 1 10 0 20 0 42 1 10 1 20 0 42 1"),
        [[0, -500, 1000, 500]]
    );
    assert_eq!(
        of("0 LWPOLYLINE 8 1 70 0 43 0.1 10 0 20 0 10 1 20 0"),
        [[0, -50, 1000, 50]]
    );
    // A filled square beside a half disc of an arc and a line.
    let hatch = "0 HATCH 8 1 10 0 20 0 70 1 91 2 92 2 72 0 73 1 93 4 10 0 20 0 10 1 20 0 10 1 20 1 10 0 20 1 97 0 \
        92 1 93 2 72 2 10 4 20 0 40 1 50 0 51 180 73 1 72 1 10 3 20 0 11 5 21 0 97 0 75 1";
    assert_eq!(of(hatch), [[0, 0, 1000, 1000], [3000, 0, 5000, 1000]]);
    let old = "0 POLYLINE 8 1 66 1 70 1 0 VERTEX 8 1 10 0 20 0 0 VERTEX 8 1 10 1 20 0 0 VERTEX 8 1 10 0 20 1 0 SEQEND";
    assert_eq!(of(old), [[0, 0, 1000, 1000]]);
    // Lines and a half circle that meet.
    let slot = "0 LINE 8 1 10 0 20 0 11 1 21 0 0 ARC 8 1 10 1 20 0.5 40 0.5 50 270 51 90 0 LINE 8 1 10 0 20 1 11 1 21 1 \
        0 LINE 8 1 10 0 20 1 11 0 21 0";
    assert_eq!(of(slot), [[0, 0, 1500, 1000]]);
    assert_eq!(of(&format!("{SQUARE} 67 1 0 LINE 8 1")), Vec::<[i64; 4]>::new());
}

/// Blocks turned, mirrored, in arrays and stretched; entities on layer 0 take the layer of the block.
#[test]
fn blocks_are_cells() {
    let block = "0 BLOCK 8 0 2 P 10 0.1 20 0 0 LWPOLYLINE 8 0 70 1 10 0.1 20 0 10 0.5 20 0 10 0.5 20 0.1 10 0.1 20 0.1 0 ENDBLK";
    let of = |insert: &str| read(&drawing("", block, &format!("0 INSERT 8 7 2 p {insert}")));
    let (layout, _) = of("10 1 20 2");
    assert_eq!(boxes(&layout), [[1000, 2000, 1400, 2100]]);
    assert!(
        layout
            .cells()
            .iter()
            .any(|cell| cell.layers.iter().any(|(layer, _)| layer.layer == 7))
    );
    assert_eq!(boxes(&of("10 0 20 0 50 90 41 2 42 2").0), [[-200, 0, 0, 800]]);
    assert_eq!(boxes(&of("10 0 20 0 41 -1").0), [[-400, 0, 0, 100]]);
    assert_eq!(boxes(&of("10 0 20 0 230 -1").0), [[-400, 0, 0, 100]]);
    assert_eq!(boxes(&of("10 0 20 0 41 2").0), [[0, 0, 800, 100]]);
    let lefts = |layout: &Layout| boxes(layout).iter().map(|b| b[0]).collect::<Vec<_>>();
    assert_eq!(lefts(&of("10 0 20 0 70 3 71 1 44 1").0), [0, 1000, 2000]);
    assert_eq!(lefts(&of("10 0 20 0 70 3 71 1 44 0.3335").0), [0, 334, 667]);
}

#[test]
fn what_is_not_read_is_said_or_refused() {
    let odd = drawing(
        "",
        "",
        &format!("{SQUARE} 0 SPLINE 8 1 0 LINE 8 1 10 0 20 0 11 1 21 1 0 INSERT 8 1 2 NONE"),
    );
    let (layout, said) = read(&odd);
    assert_eq!((boxes(&layout).len(), said.len()), (1, 4), "{said:?}");
    let strict = Hears {
        strict: true,
        ..Hears::default()
    };
    let cause = |text: &str, hears: &Hears| match read_by(text, hears) {
        Err(Error::Layout { cause, .. }) => cause,
        other => panic!("{:?}", other.map(|_| ())),
    };
    assert!(matches!(cause(&odd, &strict), LayoutError::Drawing { .. }));
    let hears = Hears::default();
    let number = drawing("", "", &SQUARE.replace("0.3", "x"));
    assert!(matches!(
        cause(&number, &hears),
        LayoutError::Drawing {
            what: "a value is no number",
            ..
        }
    ));
    assert!(matches!(
        cause("0\nSECTION\nx\ny\n", &hears),
        LayoutError::Drawing { line: 3, .. }
    ));
    // Stretched blocks of stretched blocks, and one in itself.
    let mut blocks = format!("0 BLOCK 2 B0 {SQUARE} 0 ENDBLK");
    for k in 1..40 {
        let insert = format!("0 INSERT 2 B{} 10 0 20 0 41 2 ", k - 1);
        blocks += &format!(" 0 BLOCK 2 B{k} {} 0 ENDBLK", insert.repeat(8));
    }
    let bomb = drawing("", &blocks, "0 INSERT 2 B39 10 0 20 0 42 2");
    assert!(matches!(cause(&bomb, &hears), LayoutError::Drawing { .. }));
    let circle = "0 BLOCK 2 A 0 INSERT 2 A 41 2 0 ENDBLK";
    assert!(matches!(
        cause(&drawing("", circle, "0 INSERT 2 A"), &hears),
        LayoutError::Drawing { .. }
    ));
}
