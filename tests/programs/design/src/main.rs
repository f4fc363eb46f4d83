//! Designs the controller of a plant file and prints its design file.
fn main() -> Result<(), Box<dyn std::error::Error>> {
    let path = std::env::args().nth(1).ok_or("expected a plant file")?;
    let made = design::design(path.as_ref())?;
    let mut checks = made.report.checks.iter();
    assert!(checks.all(|check| check.holds), "a check does not hold");
    print!("{}", made.file);
    Ok(())
}
