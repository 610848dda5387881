//! NIST's thirty least-squares circles.

use metrology::fit::{Point, circle};

fn numbers(text: &str) -> Vec<f64> {
    text.split_whitespace()
        .map(|word| word.parse().expect("a number"))
        .collect()
}

/// The references hold for the points as printed; what remains is the rounding of 64-bit numbers of size 1e3.
#[test]
fn every_reference_circle_is_met_to_its_last_digits() {
    let Some(folder) = shared_data::path("data/nist_ls_circles/nist") else {
        return;
    };
    let mut worst = [0.0_f64; 3];
    for index in 1..=30 {
        let read = |extension: &str| {
            let path = folder.join(format!("cir2d{index}.{extension}"));
            numbers(&std::fs::read_to_string(path).unwrap())
        };
        let (data, reference) = (read("ds"), read("fit"));
        let points: Vec<Point> = data[1..]
            .chunks_exact(3)
            .map(Point::from_column_slice)
            .collect();
        assert_eq!(points.len(), data[0] as usize, "cir2d{index}");
        let fit = circle(&points).unwrap();
        let center = Point::from_column_slice(&reference[0..3]);
        let axis = Point::from_column_slice(&reference[3..6]);
        let errors = [
            (fit.shape.center - center).amax(),
            (fit.shape.radius - reference[6] / 2.0).abs(),
            fit.shape.normal.cross(&axis).norm(),
        ];
        for (worst, error) in worst.iter_mut().zip(errors) {
            *worst = worst.max(error);
        }
        assert!(
            errors.iter().all(|e| *e <= 1e-12),
            "cir2d{index}: {errors:?}"
        );
    }
    println!(
        "largest errors: centre {:.2e}, radius {:.2e}, axis {:.1e}",
        worst[0], worst[1], worst[2]
    );
}
