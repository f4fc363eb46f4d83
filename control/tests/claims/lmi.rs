use crate::matrix;
use crate::paper::*;
use control::Domain;
use control::lmi::*;
use nalgebra::DMatrix;

#[test]
fn explore() {
    let p = plant();
    for (c, r) in [(-2100.0, 1000.0)] {
        let disc = Some(Disc { center: c, radius: r });
        let region = Region { disc, ..Region::default() };
        let found = observer_gain(
            &p.augmented_dynamics(),
            &p.augmented_output(),
            &region,
            None,
            Domain::Continuous,
        )
        .unwrap();
        println!("paper {c} {r} {found:?}");
        if let Outcome::Optimal(found) = found {
            println!(
                "{:?}",
                control::eigen::eigenvalues(
                    &(p.augmented_dynamics() - found.gain * p.augmented_output())
                )
            );
        }
        let mut b = DMatrix::zeros(5, 1);
        b[4] = -1.0;
        for norm in [Norm::HInfinity, Norm::EnergyToPeak] {
            let wish = Performance {
                disturbance: b.clone(),
                output: DMatrix::identity(5, 5),
                feed: DMatrix::zeros(2, 1),
                norm,
                gamma: None,
            };
            let found = observer_gain(
                &p.augmented_dynamics(),
                &p.augmented_output(),
                &region,
                Some(&wish),
                Domain::Continuous,
            )
            .unwrap();
            println!("paper {norm:?} {c} {r} {found:?}");
            if let Outcome::Optimal(found) = found {
                println!(
                    "{:?}",
                    control::eigen::eigenvalues(
                        &(p.augmented_dynamics() - found.gain * p.augmented_output())
                    )
                );
            }
        }
    }
    for gains in [
        repaired_gains(),
        control::aso::design(&p, &CONTROLLER_POLES, &OBSERVER_POLES, None).unwrap().gains,
    ] {
        let f = gains.error_dynamics(&p);
        let abscissa = control::eigen::spectral_abscissa(&f).unwrap();
        for slack in [1e-6] {
            let region = Region { decay: Some(-abscissa * (1.0 - slack)), ..Region::default() };
            let found = certify_region(&f, &region, Domain::Continuous).unwrap();
            println!("analysis {abscissa} {slack} {found:?}");
        }
        for norm in [Norm::HInfinity, Norm::EnergyToPeak, Norm::ImpulseToEnergy] {
            let mut b = DMatrix::zeros(5, 1);
            b[4] = -1.0;
            let channel =
                Channel { a: f.clone(), b, c: DMatrix::identity(5, 5), d: DMatrix::zeros(5, 1) };
            println!("{norm:?} {:?}", certify_gain(&channel, norm, Domain::Continuous));
        }
    }
}
