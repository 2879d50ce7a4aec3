//! Vector instructions of this processor, on which the last digits of results depend.

/// Name of the processor family and of the widest vector instructions that the libraries for transforms, matrices and loops
/// take at run time, such as `x86_64 avx2`.
///
/// Machines with one name give the same bytes. With two names, products are rounded once or twice, and results differ in their
/// last digits.
#[must_use]
pub fn vector_instructions() -> String {
    let level = level();
    let family = std::env::consts::ARCH;
    if level.is_empty() {
        family.to_owned()
    } else {
        format!("{family} {level}")
    }
}

/// The steps at which the libraries choose another routine; none wider than AVX2 is built in.
#[cfg(target_arch = "x86_64")]
fn level() -> &'static str {
    let has_fma = std::is_x86_feature_detected!("fma");
    if has_fma && std::is_x86_feature_detected!("avx2") {
        "avx2"
    } else if has_fma && std::is_x86_feature_detected!("avx") {
        "avx"
    } else if std::is_x86_feature_detected!("sse4.1") {
        "sse4.1"
    } else {
        "sse2"
    }
}

/// Elsewhere one set of vector instructions is of every processor.
#[cfg(not(target_arch = "x86_64"))]
fn level() -> &'static str {
    ""
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_name_begins_with_the_family() {
        let name = vector_instructions();
        assert!(name.starts_with(std::env::consts::ARCH), "{name}");
        assert_eq!(name, vector_instructions());
    }
}
