//! Schedule of a command: its pieces of work with their expected times, so that progress and time left are those of the whole.

use std::fs;
use std::path::Path;
use std::time::{Duration, Instant};

use metalith::Design;

/// One piece of work.
struct Piece {
    /// First words of the name with which the library begins it.
    what: &'static str,
    /// Time that it is expected to take (s on two cores): a guess, which what was done before corrects.
    seconds: f64,
}

/// Pieces of work in their order. Other work has its own progress, and the time left includes the pieces after it.
#[derive(Default)]
pub(crate) struct Course {
    pieces: Vec<Piece>,
    /// Pieces that have begun.
    begun: usize,
    /// Time that pieces that ended were expected to take, and that they took (s).
    ended: [f64; 2],
    present: Option<Instant>,
}

/// Progress of the whole command: share done and time left.
pub(crate) struct CoursePlace {
    /// Number of the piece from 1, and of all; none for work that is not among them.
    pub step: Option<[usize; 2]>,
    /// Share of all that is done; of the piece alone where the course is unknown.
    pub share: f64,
    /// Time left (s), if it is known.
    pub left_s: Option<f64>,
}

/// Nanoseconds that reading takes on two cores: of each byte of a file in GDSII, in OASIS, where a byte holds many pillars.
struct PerByte([f64; 2]);

const CELLS: PerByte = PerByte([1.2, 46.0]);
const FINDING: PerByte = PerByte([2.0, 290.0]);
const READING: PerByte = PerByte([8.0, 300.0]);
const RULES: PerByte = PerByte([14.0, 400.0]);

impl PerByte {
    /// Time for a file (s), by its size and the ending of its name; none for a pipe.
    fn seconds(&self, path: &Path) -> f64 {
        let is_oasis = path.extension().is_some_and(|ending| ending == "oas");
        let bytes = fs::metadata(path).map_or(0, |file| file.len());
        self.0[usize::from(is_oasis)] * bytes as f64 * 1e-9
    }
}

/// Nanoseconds for each site of a design: its pillars made, written, read as cells and as pillars.
const SITE: [f64; 4] = [10.0, 33.0, 10.0, 78.0];

/// Nanoseconds for each site and PSF of a simulation, and PSFs of a distinct element beside those of `[verify]`: of polychromatic light
/// and out of focus.
const SITE_OF_PSF: f64 = 20.0;
const OTHER_PSFS: usize = 24;

/// Seconds for the kernels of a camera, for its stray light, and for each picture of 800 x 800 pixels.
const KERNELS: f64 = 60.0;
const STRAY_LIGHT: f64 = 30.0;
const PICTURE: f64 = 15.0;

/// Seconds for a layout that is read, a frame that is simulated, and an operator that is compared with the simulation.
const READING_AND_FRAME: f64 = 4.0;

/// Names of work of the program that is no library's.
pub(crate) const FRAME: &str = "simulating the frame";
pub(crate) const OPERATOR: &str = "comparing the operator with the simulation";

impl Course {
    fn of(pieces: impl IntoIterator<Item = (&'static str, f64)>) -> Self {
        let piece = |(what, seconds)| Piece { what, seconds };
        Self {
            pieces: pieces.into_iter().map(piece).collect(),
            ..Self::default()
        }
    }

    /// The pillars of a design made, written if that is asked for, read and simulated.
    pub(crate) fn of_verification(design: &Design, is_written: bool) -> Self {
        let sites = |element| {
            let radius_um = design.lens_of(element).radius_um();
            std::f64::consts::PI * radius_um.powi(2) / design.lattice().cell_um2()
        };
        let elements = design.elements();
        let seconds = 1e-9 * elements.iter().map(sites).sum::<f64>();
        let psfs = design.verify.wavelengths_um.len() * design.verify.field_angles.len() + OTHER_PSFS;
        // Copies of an element are not simulated: of an array about one in four is none.
        let distinct = (1.0 + 0.25 * (elements.len() - 1) as f64) / elements.len() as f64;
        let [made, written, cells, pillars] = SITE.map(|ns| ns * seconds);
        let writing = is_written.then_some(("writing pillars", written));
        let read = [
            ("reading cells", cells),
            ("reading pillars", pillars),
            ("simulating elements", SITE_OF_PSF * psfs as f64 * distinct * seconds),
        ];
        Self::of(
            [("widths of the elements", made)]
                .into_iter()
                .chain(writing)
                .chain(read),
        )
    }

    /// The pillars of a design made and written, where symmetries leave an eighth of them.
    pub(crate) fn of_layout(design: &Design) -> Self {
        let pieces = Self::of_verification(design, true).pieces.into_iter().take(2);
        Self::of(pieces.map(|piece| (piece.what, piece.seconds)))
    }

    /// A layout read and checked against rules.
    pub(crate) fn of_check(path: &Path) -> Self {
        Self::of([
            ("reading cells", CELLS.seconds(path)),
            ("reading shapes", READING.seconds(path)),
            ("rules", RULES.seconds(path)),
        ])
    }

    /// Two layouts read and compared.
    pub(crate) fn of_comparison(files: [&Path; 2]) -> Self {
        let [a, b] = files;
        let comparing = 0.1 * (READING.seconds(a) + READING.seconds(b));
        Self::of([
            ("reading cells", CELLS.seconds(a)),
            ("reading cells", CELLS.seconds(b)),
            ("finding elements", FINDING.seconds(a)),
            ("finding elements", FINDING.seconds(b)),
            ("reading the first layout", READING.seconds(a)),
            ("reading the second layout", READING.seconds(b)),
            ("comparing pillars", comparing),
        ])
    }

    /// Kernels, stray light and frames of each camera, and so many pictures restored from the frames of each.
    pub(crate) fn of_pictures(cameras: usize, pictures: usize) -> Self {
        let camera = [
            ("reading the layout", READING_AND_FRAME),
            ("simulating kernels", KERNELS),
            ("tracing the stray light", STRAY_LIGHT),
            (FRAME, READING_AND_FRAME),
            (OPERATOR, READING_AND_FRAME),
        ];
        let restoring = std::iter::repeat_n(("restoring", PICTURE), pictures);
        let all = std::iter::repeat_n(camera.into_iter().chain(restoring), cameras);
        Self::of(all.flatten())
    }

    /// Work of this name begins.
    pub(crate) fn begin(&mut self, what: &str, now: Instant) {
        self.end(now);
        let next = self.pieces[self.begun..]
            .iter()
            .position(|piece| what.starts_with(piece.what));
        if let Some(next) = next {
            self.begun += next + 1;
            self.present = Some(now);
        }
    }

    fn end(&mut self, now: Instant) {
        if let (Some(begun), Some(last)) = (self.present.take(), self.begun.checked_sub(1)) {
            self.ended[0] += self.pieces[last].seconds;
            self.ended[1] += (now - begun).as_secs_f64();
        }
    }

    /// Place of the present work, of which a share is done after a time.
    pub(crate) fn place(&self, share: f64, after: Duration) -> CoursePlace {
        /// Share of a piece from which on its own time counts more than the expected one.
        const KNOWN: f64 = 0.05;
        /// Times of a piece beyond which it is not known how long it lasts, while it reports nothing.
        const OVERDUE: f64 = 1.5;
        let (share, after_s) = (share.clamp(0.0, 1.0), after.as_secs_f64());
        let all: f64 = self.pieces.iter().map(|piece| piece.seconds).sum();
        let is_after_all = self.present.is_none() && self.begun == self.pieces.len();
        if all <= 0.0 || is_after_all {
            return CoursePlace {
                step: None,
                share,
                left_s: (share > 0.0).then(|| after_s * (1.0 - share) / share),
            };
        }
        let number = self.present.and(self.begun.checked_sub(1));
        let expected_s = number.map_or(0.0, |last| self.pieces[last].seconds);
        let later_s: f64 = self.pieces[self.begun..].iter().map(|piece| piece.seconds).sum();
        // Pieces take longer than expected on a slow machine: as those did that are done.
        let is_told = number.is_some() && share > 0.0;
        let [expected, took] = [
            self.ended[0] + share * expected_s,
            self.ended[1] + if is_told { after_s } else { 0.0 },
        ];
        let slowness = if expected > 0.01 * all { took / expected } else { 1.0 };
        let guessed_s = slowness * expected_s;
        let own_s = if share > 0.0 {
            let known = if expected_s > 0.0 { KNOWN } else { 0.0 };
            Some(((after_s + known * guessed_s) / (share + known) - after_s).max(0.0))
        } else if number.is_none() {
            Some(0.0)
        } else {
            (after_s < OVERDUE * guessed_s).then(|| (guessed_s - after_s).max(0.0))
        };
        CoursePlace {
            step: number.map(|last| [last + 1, self.pieces.len()]),
            share: (all - later_s - (1.0 - share) * expected_s) / all,
            left_s: own_s.map(|own_s| own_s + slowness * later_s),
        }
    }
}

/// A time left in words.
pub(crate) fn left(seconds: f64) -> String {
    /// Limit below which a time is written in seconds (s).
    const MOST_SECONDS: f64 = 180.0;
    /// Limit below which a time is written in minutes (s).
    const MOST_MINUTES: f64 = 3.0 * 3600.0;
    if seconds < MOST_SECONDS {
        format!("{seconds:.0} s left")
    } else if seconds < MOST_MINUTES {
        format!("{:.0} min left", seconds / 60.0)
    } else {
        format!("{:.1} h left", seconds / 3600.0)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn time_left_is_that_of_all_pieces() {
        let begun = Instant::now();
        let mut course = Course::of([("reading", 10.0), ("simulating", 30.0)]);
        course.begin("reading", begun);
        let place = course.place(0.5, Duration::from_secs(10));
        assert_eq!(place.step, Some([1, 2]));
        assert_eq!(place.share, 0.125);
        // Twice as slow as expected: 10 s of its own, and twice 30 s.
        assert!((place.left_s.unwrap() - 70.0).abs() < 1e-9);
        // Work that nobody expected takes its own time, and those after it theirs.
        course.begin("cells", begun + Duration::from_secs(20));
        let place = course.place(0.5, Duration::from_secs(3));
        assert_eq!((place.step, place.share), (None, 0.25));
        assert!((place.left_s.unwrap() - 63.0).abs() < 0.5, "{:?}", place.left_s);
        course.begin("simulating", begun + Duration::from_secs(26));
        // While nothing is told, time passes; beyond its time it is not known.
        let place = course.place(0.0, Duration::from_secs(20));
        assert_eq!(place.left_s, Some(40.0));
        assert_eq!(course.place(0.0, Duration::from_secs(100)).left_s, None);
        let place = course.place(1.0, Duration::from_mins(1));
        assert_eq!((place.step, place.share, place.left_s), (Some([2, 2]), 1.0, Some(0.0)));
        // So does work after all that was expected.
        course.begin("packing", begun + Duration::from_secs(90));
        let place = course.place(0.5, Duration::from_secs(3));
        assert_eq!((place.step, place.share, place.left_s), (None, 0.5, Some(3.0)));
    }

    #[test]
    fn work_without_a_course_is_told_alone() {
        let place = Course::default().place(0.25, Duration::from_secs(30));
        assert_eq!((place.step, place.share, place.left_s), (None, 0.25, Some(90.0)));
    }
}
