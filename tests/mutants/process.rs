//! Memory and time of the process, as the kernel counts them.

use std::fs;

/// Ticks of a second in `/proc`: fixed by Linux for programs.
const TICKS: f64 = 100.0;

/// CPU time of all threads so far (s).
pub(crate) fn cpu_s() -> f64 {
    let stat = fs::read_to_string("/proc/self/stat").unwrap_or_default();
    // The name in parentheses may hold blanks; user and system time are the 12th and 13th fields after it.
    let fields = stat.rsplit(')').next().unwrap_or_default().split_whitespace();
    fields
        .skip(11)
        .take(2)
        .filter_map(|t| t.parse::<f64>().ok())
        .sum::<f64>()
        / TICKS
}

/// Begin to look for the largest memory anew.
pub(crate) fn forget_peak() {
    // Refused in some containers: the peak is then that of the whole process, a stricter figure.
    let _ = fs::write("/proc/self/clear_refs", "5");
}

/// Largest resident memory (bytes) since [`forget_peak`].
pub(crate) fn peak_bytes() -> u64 {
    let status = fs::read_to_string("/proc/self/status").unwrap_or_default();
    let line = status.lines().find_map(|l| l.strip_prefix("VmHWM:"));
    let kilobytes = line.and_then(|l| l.trim().trim_end_matches("kB").trim().parse::<u64>().ok());
    kilobytes.unwrap_or(0) << 10
}
