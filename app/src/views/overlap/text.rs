//! Numbers as the view writes them, with their units.

/// Millilitres: `123.4 ml`, `12.34 ml`, `0.012 ml`, `0 ml`; what is smaller than half the last
/// digit but not zero is `< 0.0001 ml`.
pub fn ml(ml: f64) -> String {
    match ml {
        0.0 => "0 ml".to_owned(),
        v if v >= 99.995 => format!("{v:.1} ml"),
        v if v >= 0.9995 => format!("{v:.2} ml"),
        v if v >= 0.0095 => format!("{v:.3} ml"),
        v if v >= 0.00005 => format!("{v:.4} ml"),
        _ => "< 0.0001 ml".to_owned(),
    }
}

/// A share of 0 to 1 in per cent: `43 %`, `3.2 %`, `< 0.1 %`, `0 %`; `> 99.9 %` is not yet all.
pub fn share(share: f64) -> String {
    let percent = share * 100.0;
    match percent {
        0.0 => "0 %".to_owned(),
        p if p < 0.05 => "< 0.1 %".to_owned(),
        p if p < 9.95 => format!("{p:.1} %"),
        p if (99.5..100.0).contains(&p) => format!("{:.1} %", p.min(99.9)),
        p => format!("{p:.0} %"),
    }
}

/// A count with thin spaces between the thousands: `1 234 567`.
pub fn count(n: u64) -> String {
    let digits = n.to_string();
    let mut out = String::with_capacity(digits.len() * 4 / 3);
    for (i, c) in digits.chars().enumerate() {
        if i > 0 && (digits.len() - i).is_multiple_of(3) {
            out.push('\u{2009}');
        }
        out.push(c);
    }
    out
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn millilitres_have_sensible_digits() {
        let all = [0.0, 0.00001, 0.0012, 0.012, 0.5, 1.0, 12.34, 99.996, 123.44].map(ml);
        let want = [
            "0 ml",
            "< 0.0001 ml",
            "0.0012 ml",
            "0.012 ml",
            "0.500 ml",
            "1.00 ml",
            "12.34 ml",
            "100.0 ml",
            "123.4 ml",
        ];
        assert_eq!(all, want);
    }

    #[test]
    fn shares_never_round_to_none_or_all() {
        let all = [0.0, 0.0001, 0.032, 0.0996, 0.434, 0.9999, 1.0].map(share);
        assert_eq!(all, ["0 %", "< 0.1 %", "3.2 %", "10 %", "43 %", "99.9 %", "100 %"]);
    }

    #[test]
    fn thousands_are_set_apart() {
        assert_eq!(
            [0, 999, 1000, 1_234_567].map(count),
            ["0", "999", "1\u{2009}000", "1\u{2009}234\u{2009}567"]
        );
    }
}
