//! Figures as a person says them, on terminals and pages alike.

/// A duration as a person says it.
pub fn seconds(s: f64) -> String {
    if s < 0.1 {
        format!("{:.0} ms", s * 1e3)
    } else if s < 100.0 {
        format!("{s:.1} s")
    } else if s < 6000.0 {
        format!("{:.1} min", s / 60.0)
    } else {
        format!("{:.1} h", s / 3600.0)
    }
}

/// A share as a person says it.
pub fn per_cent(x: f64) -> String {
    if x < 0.1 { format!("{:.2} %", x * 100.0) } else { format!("{:.1} %", x * 100.0) }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn figures_have_three_digits_or_less() {
        let times = [0.0, 0.0124, 0.0996, 0.1, 99.94, 100.0, 5990.0, 6000.0].map(seconds);
        assert_eq!(times, ["0 ms", "12 ms", "100 ms", "0.1 s", "99.9 s", "1.7 min", "99.8 min", "1.7 h"]);
        let shares = [0.0, 0.000_36, 0.0184, 0.0999, 0.1, 1.0].map(per_cent);
        assert_eq!(shares, ["0.00 %", "0.04 %", "1.84 %", "9.99 %", "10.0 %", "100.0 %"]);
    }
}
