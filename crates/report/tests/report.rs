//! One page with every part that a report can have, as a reader's browser would get it.

use metalith_pillars::{Lattice, PillarMap};
use metalith_report::{
    Axis, Cell, Chart, Column, Figure, HeatMap, ImageGrid, Page, PillarZoom, Plan, Ranking, Table, Verdict, count,
};
use ndarray::Array2;

/// A page with this many figures was measured at 150 kB; images must stay compressed.
const LARGEST_PAGE: usize = 300_000;

fn airy_like(n: usize, widen: f64) -> Array2<f64> {
    Array2::from_shape_fn((n, n), |(i, j)| {
        let middle = (n as f64 - 1.0) / 2.0;
        let r = (i as f64 - middle).hypot(j as f64 - middle + 6.0) / (4.0 * widen) + 1e-9;
        (r.sin() / r).powi(2)
    })
}

fn lens() -> PillarMap {
    let mut map = PillarMap::empty(Lattice::covering(60_000, 350).unwrap());
    let lattice = map.lattice;
    for iy in 0..lattice.sites() {
        for ix in 0..lattice.sites() {
            let r_um = lattice.coordinate_um(ix).hypot(lattice.coordinate_um(iy));
            if r_um <= 30.0 {
                let turns = (r_um.hypot(144.0) - 144.0) / 0.55;
                map.number[[iy, ix]] = 100 + 2 * ((1.0 - turns.fract()) * 94.0) as u16;
            }
        }
    }
    map
}

fn chip() -> Figure {
    let mut plan = Plan::new("The whole chip").width(560.0);
    let outline = plan.outlines("chip outline");
    let lenses = plan.layer("pillars");
    let marks = plan.solid("marks");
    plan.rectangle(outline, (-5000.0, -5000.0), (5000.0, 5000.0));
    for row in -1..=1 {
        for col in -1..=1 {
            let (x, y) = (2420.0 * f64::from(col), 2420.0 * f64::from(row));
            plan.circle(lenses, x, y, 500.0);
            plan.label(x, y, format!("({col}, {row})"));
        }
    }
    for (x, y) in [
        (-4500.0, -4500.0),
        (4500.0, -4500.0),
        (4500.0, 4500.0),
        (-4500.0, 4500.0),
    ] {
        plan.cross(marks, (x, y), 400.0, 40.0);
    }
    plan.caption("Nine lenses, 2.42 mm apart, seen from the pillar side.")
}

fn charts() -> [Figure; 4] {
    let frequency = || Axis::linear("spatial frequency", "1/mm");
    let mtf = |widen: f64| (0..=100).map(move |i| (f64::from(i), (-f64::from(i) * widen / 60.0).exp()));
    let mut curves = Chart::new("MTF", frequency(), Axis::linear("MTF", "").range(0.0, 1.0)).size(540.0, 320.0);
    curves
        .line("limit of diffraction", mtf(0.4))
        .line("designed", mtf(0.9))
        .line("extracted", mtf(1.0));
    curves.marker(42.7, "42.7").marker(85.3, "85.3").limit(0.2, "limit");
    let mut spectrum = Chart::new("Strehl", Axis::linear("wavelength", "nm"), Axis::log("Strehl", ""));
    spectrum
        .line(
            "hyperbolic",
            (400..=700).map(|l| (f64::from(l), 0.9 / (1.0 + (f64::from(l) - 550.0).powi(2) / 9.0))),
        )
        .line(
            "optimised",
            (400..=700).map(|l| (f64::from(l), 0.014 + 0.003 * (f64::from(l) / 9.0).sin())),
        );
    let mut widths = Chart::new("Widths", Axis::linear("width", "nm"), Axis::linear("pillars", "")).size(540.0, 320.0);
    let histogram = lens().histogram();
    let bars = histogram.iter().enumerate().skip(100).step_by(2);
    widths.bars(
        "written",
        bars.map(|(w, &n)| (w as f64 - 1.0, w as f64 + 1.0, n as f64)),
    );
    let mut sem = Chart::new("SEM", Axis::linear("drawn width", "nm"), Axis::linear("bias", "nm")).size(540.0, 320.0);
    sem.band("model", (100..=300).map(|w| (f64::from(w), -9.0, -3.0)));
    sem.points_with_errors(
        "centre",
        (0..9).map(|i| (110.0 + 20.0 * f64::from(i), -6.0 + f64::from(i % 3), 1.5)),
    );
    sem.points_with_errors(
        "edge",
        (0..9).map(|i| (115.0 + 20.0 * f64::from(i), -7.0 + f64::from(i % 4), 1.0)),
    );
    [
        curves.caption("MTF through the focus at 550 nm; dotted lines mark the frequencies judged."),
        spectrum.direct_labels().caption("Strehl over the band."),
        widths.caption("How often each width occurs."),
        sem.caption("Widths seen from above, against the fitted model (band: 95 % interval)."),
    ]
}

fn maps() -> [Figure; 2] {
    let wavelength = || (Axis::linear("wavelength", "nm"), 400.0, 700.0);
    let width = || (Axis::linear("width", "nm"), 100.0, 300.0);
    let t0 = Array2::from_shape_fn((101, 151), |(i, j)| {
        let resonance = (i as f64 - 0.8 * j as f64).abs() / 3.0;
        0.9 * (1.0 - 0.95 / (1.0 + resonance * resonance))
    });
    let residual = t0.mapv(|t| if t > 0.899 { f64::NAN } else { 0.3 * (t * 40.0).sin() });
    let t0 = HeatMap::new("T0 over width and wavelength", t0, wavelength(), width())
        .values("zero-order transmission", "")
        .range(0.0, 1.0)
        .contour((0..=150).map(|j| (400.0 + 2.0 * f64::from(j), 100.0 + 1.6 * f64::from(j) + 20.0)))
        .mark(550.0, 200.0, "200 nm at 550 nm");
    let residual = HeatMap::new("Residual of the fit", residual, wavelength(), width())
        .values("phase error", "rad")
        .diverging();
    [
        t0.caption("Dark: guided-mode resonances. Ring: the strongest."),
        residual.caption("What the polynomial misses; grey where there is no value."),
    ]
}

fn page() -> Page {
    let mut page = Page::new(
        "prototype_3x3",
        "1 mm lenses, F/2.4, written from `designs/prototype_3x3.toml`",
    );
    page.verdict(
        Verdict::Fail,
        "1 of 3 limits is not met: Strehl at 650 nm, element (1, 1).",
    );
    page.facts(&[
        ("Pillars", count(57_702_924)),
        ("Distinct elements", "3".into()),
        ("Layout", "17.2 MB".into()),
        ("Largest width error", "0 nm".into()),
    ]);
    page.section("Limits");
    let mut table = Table::new([
        Column::text("What"),
        Column::number("Limit", "nm"),
        Column::number("Reached", "nm"),
        Column::verdict(),
    ])
    .caption("From the design file");
    table.row([
        "rms width error".into(),
        Cell::fixed(0.5, 1),
        Cell::sig(0.0123, 3),
        Verdict::Pass.into(),
    ]);
    table.row([
        "CD bias <b>".into(),
        Cell::fixed(6.0, 1),
        Cell::sig(-8.25, 3),
        Verdict::Fail.into(),
    ]);
    table.row([
        Cell::code("taper"),
        Cell::none(),
        Cell::from(1234.5),
        Verdict::NotRun.into(),
    ]);
    page.table(table);
    page.note("These are twins, not a bench: made by a program, with noise drawn at random.");
    page.section("Layout");
    let zoom = PillarZoom::new("Pillars", &lens(), (20.0, 12.0), 9.0).side(420.0);
    page.row([chip(), zoom.caption("Pillars of element (0, 0), to scale.")]);
    page.section("Curves");
    page.row(charts());
    page.section("Maps");
    page.row(maps());
    let mut psf = ImageGrid::new("PSF, designed and extracted", 3)
        .log(4.0)
        .pixel_um(0.35)
        .values("|E|² / |E_inc|²", "");
    for label in ["455 nm, 0°", "530 nm, 0°", "660 nm, 0°"] {
        psf.image(format!("designed, {label}"), airy_like(128, 1.0));
    }
    for label in ["455 nm, 0°", "530 nm, 0°", "660 nm, 0°"] {
        psf.image(format!("extracted, {label}"), airy_like(128, 1.1));
    }
    page.figure(psf.caption("PSFs on one logarithmic scale of four decades below the highest peak."));
    page.section("Candidates");
    let mut ranking = Ranking::new("Candidates", Axis::linear("held-out gain", ""));
    ranking.bar("cd_bias", 0.42, Some((0.39, 0.45)), "chosen", true);
    ranking.bar(
        "sidewall_taper",
        0.40,
        Some((0.35, 0.43)),
        "confounded with cd_bias",
        false,
    );
    ranking.bar("gap", -0.02, None, "no gain", false);
    page.figure(ranking.caption("What each effect explains on captures that were not fitted."));
    page.details("The numbers behind the picture", |inner| {
        inner
            .code("metalith run designs/prototype_3x3.toml --out out")
            .list(["one", "`two`"]);
    });
    page
}

#[test]
fn a_page_needs_nothing_but_itself_and_is_the_same_every_time() {
    let path = std::path::Path::new(env!("CARGO_TARGET_TMPDIR")).join("report.html");
    page().write(&path).unwrap();
    let html = std::fs::read_to_string(&path).unwrap();
    assert_eq!(html, page().html(), "the same report gives the same bytes");
    assert!(html.len() < LARGEST_PAGE, "{} bytes", html.len());
    for needs in ["<script", "<link", "url(", "src=", "@import"] {
        assert!(!html.contains(needs), "{needs} would need something outside the file");
    }
    // Addresses lead nowhere but into the page, to an embedded image, or name the SVG format.
    for (at, _) in html.match_indices("http") {
        assert!(html[at..].starts_with("http://www.w3.org/2000/svg"));
    }
    for (at, _) in html.match_indices("href=\"") {
        let to = &html[at + 6..];
        assert!(
            to.starts_with("#s") || to.starts_with("data:image/png;base64,"),
            "{}",
            &to[..40]
        );
    }
    // Images are base64, in which any three letters may meet.
    const IMAGE: &str = "data:image/png;base64,";
    let written = html.split(IMAGE).map(|part| part.trim_start_matches(|c| c != '"'));
    for part in written.chain(html.split(IMAGE).take(1)) {
        assert!(!part.contains("NaN") && !part.contains("inf\""));
    }
}

#[test]
fn elements_close_as_they_open() {
    let html = page().html();
    let mut open: Vec<&str> = Vec::new();
    for part in html.split('<').skip(1) {
        let tag = part.split('>').next().unwrap();
        let name = tag.trim_start_matches('/').split([' ', '\n']).next().unwrap();
        if tag.starts_with('!') || tag.ends_with('/') || ["meta", "img", "br"].contains(&name) {
            continue;
        }
        if tag.starts_with('/') {
            assert_eq!(open.pop(), Some(name));
        } else {
            open.push(name);
        }
    }
    assert!(open.is_empty(), "{open:?}");
}

#[test]
fn every_figure_says_in_words_what_it_shows() {
    let html = page().html();
    let figures = html.matches("<figure").count();
    assert!(figures >= 10);
    assert_eq!(html.matches("role=\"img\"").count(), figures);
    assert_eq!(html.matches("<desc>").count(), figures);
    assert!(html.contains("MTF from 0 to 1.00 over spatial frequency [1/mm] from 0 to 100"));
}

#[test]
fn nothing_to_show_and_odd_numbers_still_give_a_page() {
    let odd = [f64::NAN, f64::INFINITY, f64::NEG_INFINITY, 0.0, -1.0, 1e300, 1e-300];
    let mut page = Page::new("", "");
    for axis in [
        Axis::linear("x", ""),
        Axis::log("x", ""),
        Axis::log("x", "").range(0.0, 0.0),
    ] {
        page.figure(Chart::new("empty", axis.clone(), axis.clone()));
        let mut chart = Chart::new("odd", axis.clone(), axis.clone());
        chart
            .line("line", odd.map(|x| (x, x)))
            .band("band", odd.map(|x| (x, x, -x)));
        chart
            .points_with_errors("points", odd.map(|x| (x, 1.0, x)))
            .bars("bars", odd.map(|x| (x, x + 1.0, x)));
        chart.limit(f64::NAN, "limit").marker(f64::INFINITY, "marker");
        page.figure(chart);
        page.figure(Ranking::new("empty", axis.clone()));
        let mut ranking = Ranking::new("odd", axis);
        for x in odd {
            ranking.bar("bar", x, Some((x, -x)), "", false);
        }
        page.figure(ranking);
    }
    for values in [
        Array2::zeros((0, 0)),
        Array2::zeros((1, 1)),
        Array2::from_shape_fn((2, 3), |(i, j)| odd[i * 3 + j]),
    ] {
        let axes = || (Axis::linear("x", "um"), 0.0, 0.0);
        page.figure(HeatMap::new("linear", values.clone(), axes(), axes()).mark(f64::NAN, 0.0, "m"));
        page.figure(
            HeatMap::new("log", values.clone(), axes(), axes())
                .log()
                .contour([(f64::NAN, 0.0)]),
        );
        page.figure(
            HeatMap::new("diverging", values.clone(), axes(), axes())
                .diverging()
                .to_scale(),
        );
        page.figure(
            HeatMap::new("cyclic", values.clone(), axes(), axes())
                .cyclic()
                .range(1.0, 0.0),
        );
        let mut grid = ImageGrid::new("grid", 0).log(3.0).pixel_um(0.0);
        grid.image("image", values);
        page.figure(grid);
    }
    page.figure(ImageGrid::new("empty", 2));
    page.figure(Plan::new("empty"));
    let mut plan = Plan::new("odd");
    let layer = plan.layer("layer");
    plan.circle(layer, f64::NAN, 0.0, 1.0)
        .polygon(layer, [])
        .rectangle(layer, (0.0, 0.0), (0.0, 0.0));
    page.figure(plan);
    page.figure(PillarZoom::new("beside the lens", &lens(), (1e6, -1e6), 1e9));
    page.table(Table::new([])).facts(&[]).row([]).list(Vec::<String>::new());
    let html = page.html();
    for no_number in ["NaN", "inf\"", "inf "] {
        assert!(!html.contains(no_number), "{no_number} in a drawing");
    }
}
