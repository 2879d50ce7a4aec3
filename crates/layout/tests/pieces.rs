//! Layouts of kept pieces: the bytes of one run, whatever was there, and whoever made it.

use std::fs;
use std::path::Path;

use metalith_core::{Error, Progress, Silent};
use metalith_design::{Design, Hierarchy, PillarArray};
use metalith_layout::{
    KeptPieces, LayoutFormat, OasisEncoding, PieceShard, make_pieces, write_pillars_as, write_pillars_by_pieces,
};
use metalith_testing::design;

/// Whoever stops the work after so many steps of progress.
struct StopsAfter(std::sync::atomic::AtomicI64);

impl Progress for StopsAfter {
    fn begin(&self, _what: &str, _steps: u64) {}

    fn advance(&self, _steps: u64) {
        self.0.fetch_sub(1, std::sync::atomic::Ordering::Relaxed);
    }

    fn stopped(&self) -> bool {
        self.0.load(std::sync::atomic::Ordering::Relaxed) <= 0
    }
}

fn pieces_in(folder: &Path) -> usize {
    let entries = fs::read_dir(folder).unwrap();
    let names = entries.map(|entry| entry.unwrap().file_name().into_string().unwrap());
    names.filter(|name| name.ends_with(".piece")).count()
}

#[test]
fn kept_pieces_make_the_bytes_of_one_run() {
    let folder = tempfile::tempdir().unwrap();
    let mixed = Design::read(&design("mixed_lenses")).unwrap();
    let array = PillarArray::build(&mixed, &Silent).unwrap();
    let cases = [
        (Hierarchy::Folded, OasisEncoding::Compact),
        (Hierarchy::Flat, OasisEncoding::Compact),
        (Hierarchy::Folded, OasisEncoding::Plain),
        (Hierarchy::Flat, OasisEncoding::Smallest),
    ];
    for (k, (hierarchy, encoding)) in cases.into_iter().enumerate() {
        let file = |name: &str| folder.path().join(format!("{name}_{k}.oas"));
        let (once, kept) = (file("once"), file("kept"));
        write_pillars_as(&mixed, &array, hierarchy, LayoutFormat::Oasis(encoding), &once, &Silent).unwrap();
        let pieces = folder.path().join(format!("pieces_{k}"));
        let open = || KeptPieces::open(&pieces, "one", &Silent).unwrap();
        let write = |progress: &dyn Progress| {
            let own = open();
            write_pillars_by_pieces(&mixed, &array, hierarchy, encoding, (&kept, &own), progress)
        };
        // One shard of three, then a run that is stopped, then one with a damaged piece.
        let shard = PieceShard { number: 2, of: 3 };
        make_pieces(&mixed, &array, hierarchy, encoding, (&open(), shard), &Silent).unwrap();
        let of_shard = pieces_in(&pieces);
        let stopped = write(&StopsAfter(2.into()));
        assert!(matches!(stopped, Err(Error::Interrupted)) && !kept.exists());
        assert!(pieces_in(&pieces) > of_shard, "{of_shard} of {}", pieces_in(&pieces));
        write(&Silent).unwrap();
        assert!(fs::read(&once).unwrap() == fs::read(&kept).unwrap(), "case {k}");
        let damaged = pieces.join("0_0.piece");
        let mut bytes = fs::read(&damaged).unwrap();
        *bytes.last_mut().unwrap() ^= 1;
        fs::write(&damaged, bytes).unwrap();
        write(&Silent).unwrap();
        assert!(
            fs::read(&once).unwrap() == fs::read(&kept).unwrap(),
            "case {k}, damaged"
        );

        let other = KeptPieces::open(&pieces, "another", &Silent).unwrap_err();
        assert_eq!(other.id(), "layout/other-pieces");
        open().remove().unwrap();
        assert!(!pieces.exists());
    }
    // All shards, and nothing is left to be made.
    let own = KeptPieces::open(&folder.path().join("all"), "all", &Silent).unwrap();
    let (hierarchy, encoding) = cases[1];
    for number in 1..=3 {
        make_pieces(
            &mixed,
            &array,
            hierarchy,
            encoding,
            (&own, PieceShard { number, of: 3 }),
            &Silent,
        )
        .unwrap();
    }
    let made = pieces_in(&folder.path().join("all"));
    let kept = folder.path().join("of_shards.oas");
    write_pillars_by_pieces(&mixed, &array, hierarchy, encoding, (&kept, &own), &Silent).unwrap();
    assert_eq!(made, pieces_in(&folder.path().join("all")));
    assert!(fs::read(&kept).unwrap() == fs::read(folder.path().join("once_1.oas")).unwrap());
    let taken = KeptPieces::open(folder.path(), "all", &Silent).unwrap_err();
    assert_eq!(taken.id(), "layout/other-pieces");
}
