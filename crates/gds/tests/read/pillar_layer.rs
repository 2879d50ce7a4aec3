//! Layer of the pillars where no one names it.

use super::layout;
use metalith_core::Silent;
use metalith_gds::{Error, ExtractionError, LayerNumber, Layout};
use metalith_testing::gds::Gds;

/// A layout of lenses of 10 x 10 squares and of marks, each on its layers.
fn drawn(lenses: &[i16], marks: &[i16]) -> Layout {
    let mut gds = Gds::library();
    gds.cell("TOP");
    for &layer in lenses {
        for k in 0..100 {
            gds.square(layer, 350 * (k % 10), 350 * (k / 10), 150);
        }
    }
    for &layer in marks {
        gds.polygon(layer, &[(0, 9000), (4000, 9000), (0, 12_000)]);
    }
    gds.text(63, "my lens", 0, 0);
    gds.end_cell();
    layout(gds.end())
}

#[test]
fn pillars_are_on_the_only_layer_that_has_some() {
    for (lenses, marks, layer) in [
        (&[1, 12][..], &[7][..], 1),
        (&[12], &[], 12),
        (&[12], &[7, 20], 12),
        (&[], &[7], 7),
        (&[], &[], 1),
    ] {
        let found = drawn(lenses, marks).pillar_layer(&Silent).unwrap();
        assert_eq!(found, LayerNumber::new(layer, 0), "{lenses:?} {marks:?}");
    }
}

#[test]
fn layers_that_may_be_meant_are_listed() {
    for (lenses, marks, words) in [
        (
            &[12, 13][..],
            &[7][..],
            "12/0: 100 squares; 13/0: 100 squares; 7/0: 1 polygon; text on 63/0",
        ),
        (&[], &[7, 20], "7/0: 1 polygon; 20/0: 1 polygon; text on 63/0"),
    ] {
        let error = drawn(lenses, marks).pillar_layer(&Silent).unwrap_err();
        assert!(
            matches!(&error, Error::Extraction { cause: ExtractionError::WhichLayer { contents }, .. } if contents == words),
            "{error}"
        );
    }
}
