//! Course of a command: the pieces of work that it does, so that progress is told of all of them.

use std::fs;
use std::path::Path;
use std::time::{Duration, Instant};

use metalith::Design;

/// One piece of work.
struct Piece {
    /// Name with which the library begins it.
    what: &'static str,
    /// Time that it is expected to take (s on two cores): a guess, which what was done before corrects.
    seconds: f64,
}

/// Pieces of work in their order. Work that is not among them is told alone, with the time that those after it take.
#[derive(Default)]
pub(crate) struct Course {
    pieces: Vec<Piece>,
    /// Pieces that have begun.
    begun: usize,
    /// Time that pieces that ended were expected to take, and that they took (s).
    ended: [f64; 2],
    present: Option<Instant>,
}

/// Place of a piece in a course: how much of all is done, and what is left.
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

/// Nanoseconds for each site, wavelength and field angle of a simulation.
const SITE_IN_LIGHT: f64 = 50.0;

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
        let seconds = 1e-9 * design.elements().iter().map(sites).sum::<f64>();
        let light = design.verify.wavelengths_um.len() * design.verify.field_angles.len();
        let [made, written, cells, pillars] = SITE.map(|ns| ns * seconds);
        let writing = is_written.then_some(("writing pillars", written));
        let read = [
            ("reading cells", cells),
            ("reading pillars", pillars),
            ("simulating elements", SITE_IN_LIGHT * light as f64 * seconds),
        ];
        Self::of(
            [("widths of the elements", made)]
                .into_iter()
                .chain(writing)
                .chain(read),
        )
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

    /// Work of this name begins.
    pub(crate) fn begin(&mut self, what: &str, now: Instant) {
        self.end(now);
        let next = self.pieces[self.begun..].iter().position(|piece| piece.what == what);
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
        let (share, after_s) = (share.clamp(0.0, 1.0), after.as_secs_f64());
        let by_itself = (share > 0.0).then(|| after_s * (1.0 - share) / share);
        let all: f64 = self.pieces.iter().map(|piece| piece.seconds).sum();
        if all <= 0.0 {
            return CoursePlace {
                step: None,
                share,
                left_s: by_itself,
            };
        }
        let number = self.present.and(self.begun.checked_sub(1));
        let expected_s = number.map_or(0.0, |last| self.pieces[last].seconds);
        let later_s: f64 = self.pieces[self.begun..].iter().map(|piece| piece.seconds).sum();
        // Pieces take longer than expected on a slow machine: as those did that are done.
        let [expected, took] = [
            self.ended[0] + share * expected_s,
            self.ended[1] + if number.is_some() { after_s } else { 0.0 },
        ];
        let slowness = if expected > 0.01 * all { took / expected } else { 1.0 };
        // The longer a piece is at work, the better it tells its own time.
        let guessed = (1.0 - share) * slowness * expected_s;
        let own_s = by_itself.map_or(guessed, |by_itself| share * by_itself + (1.0 - share) * guessed);
        CoursePlace {
            step: number.map(|last| [last + 1, self.pieces.len()]),
            share: (all - later_s - (1.0 - share) * expected_s) / all,
            left_s: Some(own_s + slowness * later_s),
        }
    }
}

/// A time left in words.
pub(crate) fn left(seconds: f64) -> String {
    /// Longest time that is told in seconds.
    const MOST_SECONDS: f64 = 180.0;
    /// Longest time that is told in minutes (s).
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
        assert_eq!(place.left_s, Some(70.0));
        // Work that nobody expected takes its own time, and those after it theirs.
        course.begin("cells", begun + Duration::from_secs(20));
        let place = course.place(0.5, Duration::from_secs(3));
        assert_eq!((place.step, place.share, place.left_s), (None, 0.25, Some(61.5)));
        course.begin("simulating", begun + Duration::from_secs(26));
        let place = course.place(1.0, Duration::from_secs(60));
        assert_eq!((place.step, place.share, place.left_s), (Some([2, 2]), 1.0, Some(0.0)));
    }

    #[test]
    fn work_without_a_course_is_told_alone() {
        let place = Course::default().place(0.25, Duration::from_secs(30));
        assert_eq!((place.step, place.share, place.left_s), (None, 0.25, Some(90.0)));
    }
}
