//! The comparison as a table.

use std::fmt::Write;

use metalith_imaging::Zone;
use metalith_report::sig;

use crate::compare::{ComparedCamera, ComparisonResult, MethodScores};

/// Words for cameras that are exposed for different times, which compares apertures less than it seems to; none for equal times.
pub(crate) fn unequal_times(cameras: &[ComparedCamera]) -> Option<String> {
    /// Ratio of times that count as equal.
    const EQUAL: f64 = 1.01;
    let lights = || cameras.iter().filter_map(|c| Some((&c.name, c.light.as_ref()?)));
    let times = lights().map(|(_, light)| light.time_ms);
    let [least, most] = times.fold([f64::INFINITY, 0.0], |[a, b], ms| [a.min(ms), b.max(ms)]);
    (most > EQUAL * least).then(|| {
        let each: Vec<String> = lights()
            .map(|(name, light)| format!("{name} {} ms", sig(light.time_ms, 3)))
            .collect();
        format!(
            "Exposure times differ: {}. Give --time-ms to compare at equal time.",
            each.join(", ")
        )
    })
}

impl MethodScores {
    /// Words for what was scored.
    pub fn words(&self) -> String {
        self.way
            .as_ref()
            .map_or_else(|| "frame as recorded".to_owned(), crate::Method::words)
    }
}

impl ComparisonResult {
    /// Words for the number of photographs.
    pub(crate) fn counted(&self) -> String {
        match self.photographs.len() {
            1 => "1 photograph".into(),
            n => format!("{n} photographs"),
        }
    }

    /// Words behind the size of photographs for what they were made of; empty if they are as they were given.
    pub(crate) fn averaged(&self) -> String {
        let from = self.averaged_from;
        from.map_or_else(String::new, |[rows, columns]| {
            format!(" (averaged from {columns} x {rows})")
        })
    }

    /// True if CPU seconds are stated.
    pub(crate) fn is_timed(&self) -> bool {
        self.cameras.iter().any(|c| c.ways.iter().any(|w| w.cpu_s.is_some()))
    }

    /// This comparison without CPU seconds, which no two runs agree about.
    #[must_use]
    pub fn untimed(mut self) -> Self {
        for camera in &mut self.cameras {
            camera.frame_cpu_s = None;
            camera.ways.iter_mut().for_each(|way| way.cpu_s = None);
        }
        self
    }

    /// The table in Markdown: a row for each camera and way; zones are separated by slashes.
    pub fn markdown(&self) -> String {
        let zones = Zone::ALL.map(Zone::name).join(" / ");
        let mut text = String::new();
        let mut line = |words: String| writeln!(text, "{words}").expect("strings take everything");
        if let Some(words) = &self.unequal_times {
            line(format!("**{words}**\n"));
        }
        line(format!(
            "{} of {} x {} pixels{}, sensor and light `{}`, noise of seed {}. Zones: {zones}.\n",
            self.counted(),
            self.size[1],
            self.size[0],
            self.averaged(),
            self.camera,
            self.seed
        ));
        line(
            "| camera | picture | PSNR (dB) | SSIM | 1 - LPIPS | PSNR of linear light (dB) | CPU s |\n| --- | --- | --- | --- | --- | --- | --- |"
                .into(),
        );
        for camera in &self.cameras {
            for way in &camera.ways {
                let list = |digits: usize, of: fn(&metalith_imaging::ZoneScore) -> f64| {
                    let all = way.mean.iter().map(|s| format!("{:.digits$}", of(s)));
                    all.collect::<Vec<_>>().join(" / ")
                };
                let optional =
                    |value: Option<f64>, digits: usize| value.map_or_else(String::new, |v| format!("{v:.digits$}"));
                line(format!(
                    "| {} | {} | {} | {} | {} | {} | {} |",
                    camera.name,
                    way.words(),
                    list(2, |s| s.psnr_db),
                    list(3, |s| s.ssim),
                    optional(way.one_less_lpips, 3),
                    list(2, |s| s.psnr_linear_db),
                    optional(way.cpu_s, 0),
                ));
            }
        }
        line(String::new());
        for camera in &self.cameras {
            let light = camera
                .light
                .as_ref()
                .map_or_else(String::new, |l| format!(" {}", l.sentence()));
            line(format!("- {}: {}{light}", camera.name, camera.words));
            if !camera.curve.is_empty() {
                let all = camera.curve.iter().map(|[lux, db]| format!("{db:.2} dB at {lux} lux"));
                let all: Vec<String> = all.collect();
                line(format!("  Linear light, first photograph: {}.", all.join(", ")));
            }
        }
        text
    }
}
