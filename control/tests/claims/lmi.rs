use crate::paper::*;
use control::placement::real;
use control::theorem1::*;
use nalgebra::DMatrix;

#[test]
fn explore() {
    let p = plant();
    for gains in [
        repaired_gains(),
        control::aso::design(&p, &real(&CONTROLLER_POLES), &real(&OBSERVER_POLES), None)
            .unwrap()
            .gains,
    ] {
        let f = gains.error_dynamics(&p);
        let c = certify(&p, &gains, 1.0, 30.0).unwrap();
        println!(
            "printed {} {:?} ult {}",
            c.delta,
            c.p_range,
            c.delta * (c.p_range.1 / c.p_range.0).sqrt()
        );
        let free = smallest_region(&f, &p.augmented_fault(), 30.0).unwrap();
        println!("free {free:?}");
        println!("{:?}", ultimate_bound(&f, &p.augmented_fault(), 30.0));
        let mut g = DMatrix::zeros(5, 1);
        g[4] = -1.0;
        println!("rate {:?}", smallest_region(&f, &g, 100.0));
        println!("rate {:?}", ultimate_bound(&f, &g, 100.0));
        println!("rate {:?}", largest_decay(&f).unwrap().optimal().unwrap().alpha);
    }
}
