//! CPU time of the work.

/// User and system time of this process so far (s), where the system tells it in `/proc`: fields 14 and 15, hundredths.
#[must_use]
pub fn cpu_seconds() -> Option<f64> {
    let text = std::fs::read_to_string("/proc/self/stat").ok()?;
    let behind_name = text.rsplit_once(')')?.1;
    let fields = behind_name.split_whitespace().skip(11).take(2);
    Some(fields.filter_map(|f| f.parse::<f64>().ok()).sum::<f64>() * 0.01)
}

/// Time since a moment (s), where both are known.
#[must_use]
pub fn since(moment: Option<f64>) -> Option<f64> {
    Some(cpu_seconds()? - moment?)
}
