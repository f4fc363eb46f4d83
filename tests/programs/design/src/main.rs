//! Designs the controller of a plant file and prints its design file.
fn main() -> Result<(), Box<dyn std::error::Error>> {
    let path = std::env::args().nth(1).ok_or("expected a plant file")?;
    let designed = design::design(path.as_ref())?;
    let mut checks = designed.report.checks.iter();
    assert!(checks.all(|check| check.holds), "a check does not hold");
    print!("{}", designed.file);
    Ok(())
}
