//! The named scenarios of `reproduce`: settings of the two FMUs.

/// A scenario of `reproduce`.
#[derive(Clone, Copy, Debug, PartialEq, Eq, clap::ValueEnum)]
pub(crate) enum Scenario {
    /// Nonlinear plant from x(0) = [0.1, -0.1, 0, 0], observer eigenvalues -1200 to -3000
    Paper,
    /// Linearised plant from the paper's x(0) = [1.1, -1.1, 0, 0], the same controller
    PaperLiteral,
    /// The paper's printed L with two signs corrected; the nonlinear plant becomes unstable
    PrintedGains,
}

/// The observer gain L printed after equation (21) of the paper, in units of 1000, row by row, with the signs of
/// `L[3,2]` and `L[4,2]` reversed: with the printed signs, A_0 - L C_0 is unstable.
const PRINTED_L: [[f64; 2]; 5] =
    [[0.0380, -0.0048], [-0.0038, 0.0518], [0.3792, 0.1690], [-0.1297, 0.8841], [-3.3432, 0.8941]];

impl Scenario {
    /// Returns the name on the command line.
    pub(crate) fn name(self) -> String {
        let value = clap::ValueEnum::to_possible_value(&self);
        value.map(|value| value.get_name().to_owned()).unwrap_or_default()
    }

    /// Returns the expected result if it differs from the claims of the paper.
    pub(crate) fn expectation(self) -> Option<&'static str> {
        (self == Scenario::PrintedGains).then_some(
            "expected: the printed gains lose the nonlinear plant soon after the compensation starts",
        )
    }

    /// Returns `slave.variable` and value of each setting.
    pub(crate) fn settings(self) -> Vec<(String, String)> {
        let pair = |name: &str, value: &str| (name.to_owned(), value.to_owned());
        match self {
            Scenario::Paper => Vec::new(),
            Scenario::PaperLiteral => vec![
                pair("plant.linearised", "true"),
                pair("plant.x_p_0", "1.1"),
                pair("plant.theta_0", "-1.1"),
            ],
            Scenario::PrintedGains => printed_gains(),
        }
    }
}

/// Returns the settings of the printed gains. The paper prints `col(L_x, L_f)`, so the last row is L_f as in (5).
fn printed_gains() -> Vec<(String, String)> {
    let mut settings = Vec::new();
    for (row, entries) in PRINTED_L.iter().enumerate() {
        for (column, entry) in entries.iter().enumerate() {
            let name = if row < 4 {
                format!("controller.L_x[{},{}]", row + 1, column + 1)
            } else {
                format!("controller.L_f[1,{}]", column + 1)
            };
            settings.push((name, (1e3 * entry).to_string()));
        }
    }
    settings
}
