//! One-way analysis of variance with repeated measures, Greenhouse and Geisser's correction, and Mauchly's test of sphericity.

use serde::Serialize;
use statrs::distribution::{ChiSquared, ContinuousCDF, FisherSnedecor};

/// Sums of squares below this share of the numbers' own squares are rounding.
const ROUNDING: f64 = 1e-20;

/// The analysis of variance of one measure over lights.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Anova {
    /// F statistic.
    pub f: f64,
    /// Degrees of freedom of lights.
    pub df_lights: f64,
    /// Degrees of freedom of the error.
    pub df_error: f64,
    /// p of F, for sphericity.
    pub p: f64,
    /// Greenhouse and Geisser's epsilon: 1 for sphericity, at least 1 / degrees of freedom of lights.
    pub epsilon: f64,
    /// p of F with both degrees of freedom multiplied by epsilon.
    pub p_corrected: f64,
    /// Share of the variance within participants that lights explain.
    pub partial_eta_squared: f64,
    /// The test of sphericity; null with two lights, which always have it, and where participants are too few.
    pub mauchly: Option<Mauchly>,
}

/// Mauchly's test (1940): whether differences between any two lights vary equally.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Mauchly {
    /// Its statistic, 0 to 1.
    pub w: f64,
    /// Bartlett's approximation of its distribution.
    pub chi_squared: f64,
    /// Its degrees of freedom.
    pub df: f64,
    /// p, with the second term of the approximation (Anderson).
    pub p: f64,
}

/// The share of F's distribution above `f`.
fn above(f: f64, df: [f64; 2]) -> Option<f64> {
    let distribution = FisherSnedecor::new(df[0], df[1]).ok()?;
    (f.is_finite() && f >= 0.0).then(|| distribution.sf(f))
}

/// The analysis of `rows`: a participant's numbers, one for each light. Why there is none: fewer than two rows or lights, or nothing varies
/// within participants beyond what is the same for all.
pub(super) fn anova(rows: &[Vec<f64>]) -> Result<Anova, &'static str> {
    let (n, k) = (rows.len(), rows.first().map_or(0, Vec::len));
    if n < 2 || k < 2 || rows.iter().any(|row| row.len() != k) {
        return Err("fewer than two participants with answers to every light");
    }
    let (rows_f, lights_f) = (n as f64, k as f64);
    let of_row = |row: &Vec<f64>| row.iter().sum::<f64>() / lights_f;
    let of_light = |light: usize| rows.iter().map(|row| row[light]).sum::<f64>() / rows_f;
    let mean = rows.iter().map(of_row).sum::<f64>() / rows_f;
    let light_means: Vec<f64> = (0..k).map(of_light).collect();
    let between: f64 = rows_f * light_means.iter().map(|m| (m - mean).powi(2)).sum::<f64>();
    let rest = |row: &Vec<f64>| {
        let own = of_row(row);
        row.iter().zip(&light_means).map(|(x, light)| (x - own - light + mean).powi(2)).sum::<f64>()
    };
    let error: f64 = rows.iter().map(rest).sum();
    let squares: f64 = rows.iter().flatten().map(|x| x * x).sum();
    if error.is_nan() || error <= squares * ROUNDING {
        return Err("the differences between lights are the same for every participant");
    }
    let (df_lights, df_error) = (lights_f - 1.0, (lights_f - 1.0) * (rows_f - 1.0));
    let f = (between / df_lights) / (error / df_error);
    let contrasts = contrast_covariance(rows, &light_means);
    let trace: f64 = (0..k - 1).map(|i| contrasts[i][i]).sum();
    let squared: f64 = contrasts.iter().flatten().map(|x| x * x).sum();
    let epsilon = (trace * trace / (df_lights * squared)).clamp(1.0 / df_lights, 1.0);
    let without = "F can't be computed";
    Ok(Anova {
        f,
        df_lights,
        df_error,
        p: above(f, [df_lights, df_error]).ok_or(without)?,
        epsilon,
        p_corrected: above(f, [df_lights * epsilon, df_error * epsilon]).ok_or(without)?,
        partial_eta_squared: between / (between + error),
        mauchly: mauchly(&contrasts, n),
    })
}

/// The covariance of orthonormal contrasts of the lights (Helmert's): a square matrix of one less than the lights.
fn contrast_covariance(rows: &[Vec<f64>], light_means: &[f64]) -> Vec<Vec<f64>> {
    let contrasts = light_means.len() - 1;
    // Contrast i: the mean of the lights up to i less light i + 1, at unit length.
    let of = |row: &Vec<f64>, i: usize| {
        let lights = i as f64 + 1.0;
        let over = |at: usize| row[at] - light_means[at];
        ((0..=i).map(over).sum::<f64>() - lights * over(i + 1)) / (lights * (lights + 1.0)).sqrt()
    };
    let values: Vec<Vec<f64>> = rows.iter().map(|row| (0..contrasts).map(|i| of(row, i)).collect()).collect();
    let covariance = |i: usize, j: usize| {
        values.iter().map(|value| value[i] * value[j]).sum::<f64>() / (rows.len() as f64 - 1.0)
    };
    (0..contrasts).map(|i| (0..contrasts).map(|j| covariance(i, j)).collect()).collect()
}

/// The logarithm of a symmetric matrix's determinant, by Cholesky's decomposition; `None` where it isn't positive definite.
fn log_determinant(matrix: &[Vec<f64>]) -> Option<f64> {
    let size = matrix.len();
    let mut lower = vec![vec![0.0; size]; size];
    let mut sum = 0.0;
    for i in 0..size {
        for j in 0..=i {
            let rest = matrix[i][j] - (0..j).map(|m| lower[i][m] * lower[j][m]).sum::<f64>();
            if i != j {
                lower[i][j] = rest / lower[j][j];
                continue;
            }
            // Below, the matrix is singular but for rounding.
            if rest.is_nan() || rest <= 1e-13 * matrix[i][i] {
                return None;
            }
            lower[i][i] = rest.sqrt();
            sum += rest.ln();
        }
    }
    Some(sum)
}

fn mauchly(contrasts: &[Vec<f64>], participants: usize) -> Option<Mauchly> {
    let size = contrasts.len();
    if size < 2 || participants <= size {
        return None;
    }
    let (d, df_rest, lights) = (size as f64, participants as f64 - 1.0, size as f64 + 1.0);
    let trace: f64 = (0..size).map(|i| contrasts[i][i]).sum();
    let log_w = log_determinant(contrasts)? - d * (trace / d).ln();
    let df = d * (d + 1.0) / 2.0 - 1.0;
    let factor = 1.0 - (2.0 * d * d + d + 2.0) / (6.0 * d * df_rest);
    // The number of lights in the second term as in R's mauchly.test and pingouin; Anderson (2003) has d.
    let second = (d + 2.0) * (d - 1.0) * (d - 2.0) * (2.0 * d.powi(3) + 6.0 * d * d + 3.0 * lights + 2.0)
        / (288.0 * (df_rest * d * factor).powi(2));
    let chi_squared = -df_rest * factor * log_w;
    let above = |df: f64| ChiSquared::new(df).ok().map(|distribution| distribution.sf(chi_squared));
    let (first, further) = (above(df)?, above(df + 4.0)?);
    let p = (first + second * (further - first)).clamp(0.0, 1.0);
    Some(Mauchly { w: log_w.exp(), chi_squared, df, p }).filter(|found| found.p.is_finite())
}
