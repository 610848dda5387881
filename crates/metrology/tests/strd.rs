//! NIST StRD nonlinear regressions: nine certified digits from both published starts.

mod common;

use std::ops::{Add, Div, Mul, Neg, Sub};

use metrology::solver::{Residuals, SolverOptions, least_squares};
use nalgebra::{DMatrix, DVector};

/// Value and gradient by the nine parameters at most: forward differentiation without truncation.
#[derive(Clone, Copy)]
struct Dual {
    value: f64,
    gradient: [f64; 9],
}

impl Dual {
    fn chain(self, value: f64, derivative: f64) -> Self {
        Self {
            value,
            gradient: self.gradient.map(|g| g * derivative),
        }
    }
    fn exp(self) -> Self {
        self.chain(self.value.exp(), self.value.exp())
    }
    fn cos(self) -> Self {
        self.chain(self.value.cos(), -self.value.sin())
    }
    fn sin(self) -> Self {
        self.chain(self.value.sin(), self.value.cos())
    }
    fn ln(self) -> Self {
        self.chain(self.value.ln(), 1.0 / self.value)
    }
    fn atan(self) -> Self {
        self.chain(self.value.atan(), 1.0 / (1.0 + self.value * self.value))
    }
    fn square(self) -> Self {
        self * self
    }
    fn power(self, exponent: Self) -> Self {
        (self.ln() * exponent).exp()
    }
}

fn constant(value: f64) -> Dual {
    Dual {
        value,
        gradient: [0.0; 9],
    }
}

/// Value `value` whose derivatives by the two operands are `da` and `db`.
fn combine(a: Dual, b: Dual, value: f64, da: f64, db: f64) -> Dual {
    Dual {
        value,
        gradient: std::array::from_fn(|i| a.gradient[i] * da + b.gradient[i] * db),
    }
}

macro_rules! operator {
    ($trait:ident, $method:ident, |$a:ident, $b:ident| $value:expr, $da:expr, $db:expr) => {
        impl $trait for Dual {
            type Output = Dual;
            fn $method(self, other: Dual) -> Dual {
                let ($a, $b) = (self.value, other.value);
                combine(self, other, $value, $da, $db)
            }
        }
        impl $trait<Dual> for f64 {
            type Output = Dual;
            fn $method(self, other: Dual) -> Dual {
                $trait::$method(constant(self), other)
            }
        }
        impl $trait<f64> for Dual {
            type Output = Dual;
            fn $method(self, other: f64) -> Dual {
                $trait::$method(self, constant(other))
            }
        }
    };
}
operator!(Add, add, |a, b| a + b, 1.0, 1.0);
operator!(Sub, sub, |a, b| a - b, 1.0, -1.0);
operator!(Mul, mul, |a, b| a * b, b, a);
operator!(Div, div, |a, b| a / b, 1.0 / b, -a / (b * b));

impl Neg for Dual {
    type Output = Dual;
    fn neg(self) -> Dual {
        self.chain(-self.value, -1.0)
    }
}

type Model = fn(&[Dual], f64, f64) -> Dual;

fn misra1a(b: &[Dual], x: f64, _: f64) -> Dual {
    b[0] * (1.0 - (-b[1] * x).exp())
}
fn chwirut(b: &[Dual], x: f64, _: f64) -> Dual {
    (-b[0] * x).exp() / (b[1] + b[2] * x)
}
fn gauss(b: &[Dual], x: f64, _: f64) -> Dual {
    b[0] * (-b[1] * x).exp()
        + b[2] * (-((x - b[3]) / b[4]).square()).exp()
        + b[5] * (-((x - b[6]) / b[7]).square()).exp()
}
fn lanczos(b: &[Dual], x: f64, _: f64) -> Dual {
    b[0] * (-b[1] * x).exp() + b[2] * (-b[3] * x).exp() + b[4] * (-b[5] * x).exp()
}
fn enso(b: &[Dual], x: f64, _: f64) -> Dual {
    let turn = 2.0 * std::f64::consts::PI * x;
    let (four, seven) = (turn / b[3], turn / b[6]);
    b[0] + b[1] * (turn / 12.0).cos()
        + b[2] * (turn / 12.0).sin()
        + b[4] * four.cos()
        + b[5] * four.sin()
        + b[7] * seven.cos()
        + b[8] * seven.sin()
}

/// Name, number of parameters, model as printed in the file.
const MODELS: [(&str, usize, Model); 27] = [
    ("Bennett5", 3, |b, x, _| {
        b[0] * (b[1] + x).power(-1.0 / b[2])
    }),
    ("BoxBOD", 2, misra1a),
    ("Chwirut1", 3, chwirut),
    ("Chwirut2", 3, chwirut),
    ("DanWood", 2, |b, x, _| b[0] * constant(x).power(b[1])),
    ("ENSO", 9, enso),
    ("Eckerle4", 3, |b, x, _| {
        b[0] / b[1] * (-0.5 * ((x - b[2]) / b[1]).square()).exp()
    }),
    ("Gauss1", 8, gauss),
    ("Gauss2", 8, gauss),
    ("Gauss3", 8, gauss),
    ("Hahn1", 7, |b, x, _| {
        (b[0] + b[1] * x + b[2] * x.powi(2) + b[3] * x.powi(3))
            / (1.0 + b[4] * x + b[5] * x.powi(2) + b[6] * x.powi(3))
    }),
    ("Kirby2", 5, |b, x, _| {
        (b[0] + b[1] * x + b[2] * x.powi(2)) / (1.0 + b[3] * x + b[4] * x.powi(2))
    }),
    ("Lanczos1", 6, lanczos),
    ("Lanczos2", 6, lanczos),
    ("Lanczos3", 6, lanczos),
    ("MGH09", 4, |b, x, _| {
        b[0] * (x * x + x * b[1]) / (x * x + x * b[2] + b[3])
    }),
    ("MGH10", 3, |b, x, _| b[0] * (b[1] / (x + b[2])).exp()),
    ("MGH17", 5, |b, x, _| {
        b[0] + b[1] * (-x * b[3]).exp() + b[2] * (-x * b[4]).exp()
    }),
    ("Misra1a", 2, misra1a),
    ("Misra1b", 2, |b, x, _| {
        b[0] * (1.0 - 1.0 / (1.0 + b[1] * x / 2.0).square())
    }),
    ("Misra1c", 2, |b, x, _| {
        b[0] * (1.0 - (1.0 + 2.0 * b[1] * x).power(constant(-0.5)))
    }),
    ("Misra1d", 2, |b, x, _| b[0] * b[1] * x / (1.0 + b[1] * x)),
    ("Nelson", 3, |b, x1, x2| {
        b[0] - b[1] * x1 * (-b[2] * x2).exp()
    }),
    ("Rat42", 3, |b, x, _| b[0] / (1.0 + (b[1] - b[2] * x).exp())),
    ("Rat43", 4, |b, x, _| {
        b[0] / (1.0 + (b[1] - b[2] * x).exp()).power(1.0 / b[3])
    }),
    ("Roszman1", 4, |b, x, _| {
        b[0] - b[1] * x - (b[2] / (x - b[3])).atan() / std::f64::consts::PI
    }),
    ("Thurber", 7, |b, x, _| {
        (b[0] + b[1] * x + b[2] * x.powi(2) + b[3] * x.powi(3))
            / (1.0 + b[4] * x + b[5] * x.powi(2) + b[6] * x.powi(3))
    }),
];

struct Regression {
    model: Model,
    x: Vec<(f64, f64)>,
    y: Vec<f64>,
}

impl Regression {
    fn evaluate(&self, parameters: &DVector<f64>) -> Option<Vec<Dual>> {
        let b: Vec<Dual> = parameters
            .iter()
            .enumerate()
            .map(|(j, &value)| {
                let mut seeded = constant(value);
                seeded.gradient[j] = 1.0;
                seeded
            })
            .collect();
        let values: Vec<Dual> = self
            .x
            .iter()
            .map(|&(x1, x2)| (self.model)(&b, x1, x2))
            .collect();
        values
            .iter()
            .all(|d| d.value.is_finite() && d.gradient.iter().all(|g| g.is_finite()))
            .then_some(values)
    }
}

impl Residuals for Regression {
    fn residuals(&self, parameters: &DVector<f64>) -> Option<DVector<f64>> {
        let values = self.evaluate(parameters)?;
        Some(DVector::from_fn(values.len(), |i, _| {
            values[i].value - self.y[i]
        }))
    }
    fn jacobian(&self, parameters: &DVector<f64>) -> Option<DMatrix<f64>> {
        let values = self.evaluate(parameters)?;
        Some(DMatrix::from_fn(values.len(), parameters.len(), |i, j| {
            values[i].gradient[j]
        }))
    }
}

struct Certified {
    starts: [Vec<f64>; 2],
    parameters: Vec<f64>,
    deviations: Vec<f64>,
    sum_of_squares: f64,
    regression: Regression,
}

fn parse(text: &str, name: &str, count: usize, model: Model) -> Certified {
    let numbers = |line: &str| -> Vec<f64> {
        line.split_whitespace()
            .filter_map(|word| word.parse().ok())
            .collect()
    };
    let mut rows = Vec::new();
    let mut sum_of_squares = f64::NAN;
    for line in text.lines().skip(40) {
        if rows.len() < count
            && line
                .trim_start()
                .starts_with(&format!("b{} =", rows.len() + 1))
        {
            rows.push(numbers(line.split_once('=').expect("a starting line").1));
        } else if let Some(rest) = line.strip_prefix("Residual Sum of Squares:") {
            sum_of_squares = rest.trim().parse().expect("a sum");
        }
    }
    let data: Vec<Vec<f64>> = text
        .lines()
        .skip(60)
        .map(numbers)
        .filter(|row| row.len() >= 2)
        .collect();
    assert_eq!(rows.len(), count, "{name}");
    let column = |j: usize| rows.iter().map(|row| row[j]).collect::<Vec<f64>>();
    Certified {
        starts: [column(0), column(1)],
        parameters: column(2),
        deviations: column(3),
        sum_of_squares,
        regression: Regression {
            model,
            x: data
                .iter()
                .map(|row| (row[1], row.get(2).copied().unwrap_or(0.0)))
                .collect(),
            // Nelson's model is for the logarithm of the response.
            y: data
                .iter()
                .map(|row| {
                    if name == "Nelson" {
                        row[0].ln()
                    } else {
                        row[0]
                    }
                })
                .collect(),
        },
    }
}

/// Digits of agreement, the "log relative error" of the reference.
fn digits(value: f64, certified: f64) -> f64 {
    -((value - certified).abs() / certified.abs()).log10()
}

#[test]
fn every_regression_reaches_nine_certified_digits_from_both_starts() {
    let Some(folder) = common::shared("data/nist_strd") else {
        return;
    };
    let mut failures = Vec::new();
    for (name, count, model) in MODELS {
        let text = std::fs::read_to_string(folder.join(format!("{name}.dat"))).unwrap();
        let case = parse(&text, name, count, model);
        for (which, start) in case.starts.iter().enumerate() {
            let solution = match least_squares(
                &case.regression,
                &DVector::from_vec(start.clone()),
                &SolverOptions::default(),
            ) {
                Ok(solution) => solution,
                Err(error) => {
                    failures.push(format!("{name} start {}: {error}", which + 1));
                    continue;
                }
            };
            let worst = (0..count)
                .map(|j| digits(solution.parameters[j], case.parameters[j]))
                .fold(f64::INFINITY, f64::min);
            let sum = digits(solution.sum_of_squares, case.sum_of_squares);
            let variance = solution.variance().unwrap();
            let deviation = (0..count)
                .map(|j| {
                    digits(
                        (variance * solution.cofactor[(j, j)]).sqrt(),
                        case.deviations[j],
                    )
                })
                .fold(f64::INFINITY, f64::min);
            println!(
                "{name:9} start {}: {worst:5.1} digits, sum {sum:5.1}, deviations {deviation:5.1}, {:4} iterations",
                which + 1,
                solution.iterations
            );
            // Lanczos1's certified sum, 1.4e-25, is below what 64-bit residuals of size 1e-16 can hold.
            let exact_sum = name == "Lanczos1" || (sum >= 9.0 && deviation >= 8.0);
            if worst < 9.0 || !exact_sum {
                failures.push(format!(
                    "{name} start {}: {worst:.1} {sum:.1} {deviation:.1}",
                    which + 1
                ));
            }
        }
    }
    assert!(failures.is_empty(), "{failures:#?}");
}
