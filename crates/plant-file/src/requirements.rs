//! The requirements of a plant file on state feedback and observer.

use std::f64::consts::PI;

use crate::matrix::matrix;
use crate::read::{Result, not_negative, optional, positive, positive_within, refuse};
use nalgebra::{Complex, DMatrix};

use crate::channel::{CHANNEL, Channel, ChannelSignals};
use control::{Domain, lmi};
use files::{Entry, Place, Table};

/// A requirement on a gain.
#[derive(Clone, Debug, PartialEq)]
pub enum Requirement {
    /// Eigenvalues p of the continuous loop in 1/s; for a sampled loop the eigenvalues are e^(p T).
    Eigenvalues(Vec<Complex<f64>>),
    /// Eigenvalues of the sampled loop.
    SampledEigenvalues(Vec<Complex<f64>>),
    /// Eigenvalues in a region.
    Region(Region),
    /// The least integral of x'Q x + u'R u (LQR), or the least variance for noise of intensity W
    /// and V (Kalman).
    Weights {
        /// Q of a regulator, the weight of the states; W of a filter, the intensity of the noise of the states.
        states: DMatrix<f64>,
        /// R of a regulator, the weight of the commands; V of a filter, the intensity of the noise of the measurements.
        channels: DMatrix<f64>,
    },
    /// A linear-quadratic regulator, or a Kalman filter, of a bandwidth.
    Bandwidth(Bandwidth),
    /// The least H-infinity norm, or a norm below a bound, with all eigenvalues in a region.
    HInfinity {
        /// The largest norm; `None` for the least one.
        bound: Option<f64>,
        /// The region of the eigenvalues; all stable eigenvalues if none is stated.
        region: Region,
        /// The weights of the outputs of the norm and of the measurement noise.
        channel: Channel,
    },
}

/// The bandwidth of a loop.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Bandwidth {
    /// The bandwidth in rad/s; `None` until it is chosen.
    pub rate: Option<f64>,
    /// Whether the file states the bandwidth.
    pub is_stated: bool,
}

/// A region of the left half plane: the intersection of the stated parts; the whole half plane without any.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Region {
    /// Real parts are below the negative of this rate, 1/s.
    pub decay: Option<f64>,
    /// Centre on the real axis and radius of a disc, 1/s.
    pub disc: Option<(f64, f64)>,
    /// Largest angle from the negative real axis, in degrees.
    pub sector: Option<f64>,
}

/// A requirement and its place in the file.
#[derive(Clone, Debug)]
pub struct Request {
    /// The requirement on the loop.
    pub requirement: Requirement,
    /// Place of the requirement in the file.
    pub place: Place,
    /// Name and place of the second weight, R or V; none for other requirements.
    pub other: Option<(String, Place)>,
}

impl Request {
    /// A request for a bandwidth that is yet to be chosen, as the file states no requirement; errors point at `place`.
    #[must_use]
    pub fn open(place: Place) -> Self {
        let requirement = Requirement::Bandwidth(Bandwidth { rate: None, is_stated: false });
        Self { requirement, place, other: None }
    }

    /// The bandwidth in rad/s; `None` if the requirement is another one or the bandwidth is yet to be chosen.
    #[must_use]
    pub fn bandwidth(&self) -> Option<f64> {
        match self.requirement {
            Requirement::Bandwidth(Bandwidth { rate, .. }) => rate,
            _ => None,
        }
    }

    /// Whether the requirement is a bandwidth that is yet to be chosen.
    #[must_use]
    pub fn is_open(&self) -> bool {
        matches!(self.requirement, Requirement::Bandwidth(Bandwidth { rate: None, .. }))
    }
}

impl Requirement {
    /// The eigenvalues that are stated; empty for other requirements.
    #[must_use]
    pub fn eigenvalues(&self) -> &[Complex<f64>] {
        match self {
            Self::Eigenvalues(all) | Self::SampledEigenvalues(all) => all,
            _ => &[],
        }
    }

    /// Returns the index of the first state whose row of the first weight is zero, so that a Kalman filter has no noise
    /// on it. `None` if there is no such state, and for requirements without weights.
    #[must_use]
    pub fn without_noise(&self) -> Option<usize> {
        match self {
            Self::Weights { states, .. } => {
                (0..states.nrows()).find(|&row| states.row(row).amax() == 0.0)
            }
            _ => None,
        }
    }
}

const KEYS: [&str; 5] = ["bandwidth", "eigenvalues", "sampled_eigenvalues", "region", "h_infinity"];

/// Reads `[feedback]` (`weights` Q, R) or `[observer]` (`weights` W, V): exactly one requirement; a region is a
/// requirement alone, or restricts `h_infinity`.
pub(crate) fn request(
    table: &Table<'_>,
    weights: [&str; 2],
    signals: &ChannelSignals<'_>,
    domain: Domain,
) -> Result<Request> {
    let sampled = domain != Domain::Continuous;
    let mut known = KEYS.to_vec();
    known.extend(weights);
    let allowed: Vec<_> = known.iter().copied().chain(CHANNEL).collect();
    table.allow(&allowed)?;
    if table.get("h_infinity").is_none() {
        refuse(table, &CHANNEL, "it belongs to `h_infinity`")?;
    }
    if table.get(weights[0]).is_none() {
        refuse(table, &weights[1..], &format!("it belongs to `{}`", weights[0]))?;
    }
    let region = table.get("region");
    if let Some(entry) = region.as_ref().filter(|_| sampled) {
        refuse_disc_and_sector(entry)?;
    }
    let Some((method, one)) = only_one(table, weights[0])? else {
        let Some(entry) = region else {
            let message = format!("expected one of {}", known.join(", "));
            return Err(table.source.error(&table.place, message));
        };
        let requirement = Requirement::Region(self::region(&entry)?);
        return Ok(Request { requirement, place: entry.place, other: None });
    };
    if let Some(entry) = region.as_ref().filter(|_| method != "h_infinity") {
        return Err(entry.error("a region can be combined with `h_infinity` only"));
    }
    let mut second = None;
    let requirement = match method {
        "h_infinity" => {
            let region = region.as_ref().map(self::region).transpose()?.unwrap_or_default();
            let channel = Channel::read(table, signals, domain)?;
            let remedy = match weights[0] {
                // In sampled time the gain of the least norm is finite: no gain knows the disturbance of the last
                // sample.
                _ if sampled || !channel.noise.is_empty() || region.disc.is_some() => None,
                "W" => Some("`noise`, or a `region` with a disc"),
                _ => Some("a `region` with a disc"),
            };
            Requirement::HInfinity { bound: bound(&one, remedy)?, region, channel }
        }
        "bandwidth" => Requirement::Bandwidth(bandwidth(&one, domain)?),
        "eigenvalues" => Requirement::Eigenvalues(stable(&one, false)?),
        "sampled_eigenvalues" if sampled => Requirement::SampledEigenvalues(stable(&one, true)?),
        "sampled_eigenvalues" => return Err(one.error("the design has no `sample_time`")),
        _ => {
            let other = table.require(weights[1], "the weight of the other signals")?;
            let (states, channels) = (weight(&one)?, weight(&other)?);
            second = Some((weights[1].to_owned(), other.place));
            Requirement::Weights { states, channels }
        }
    };
    Ok(Request { requirement, place: one.place, other: second })
}

/// Refuses a disc or a sector in a sampled design: the map z = e^(s T) does not preserve their shape.
fn refuse_disc_and_sector(region: &Entry<'_>) -> Result<()> {
    refuse(&region.table()?, &["disc", "sector"], "a sampled design has a region by `decay` only")
}

/// Returns the only method of the table besides a region, with its key; `None` without one. Several methods are an
/// error.
fn only_one<'a, 'k>(table: &Table<'a>, weight: &'k str) -> Result<Option<(&'k str, Entry<'a>)>> {
    let keys = ["bandwidth", "eigenvalues", "sampled_eigenvalues", "h_infinity", weight];
    let mut stated = keys.into_iter().filter_map(|key| Some((key, table.get(key)?)));
    let first = stated.next();
    match stated.next() {
        Some((_, second)) => {
            Err(second.error(format!("only one of {} is possible", keys.join(", "))))
        }
        None => Ok(first),
    }
}

/// Reads a bandwidth, in a sampled design below pi / T.
fn bandwidth(entry: &Entry<'_>, domain: Domain) -> Result<Bandwidth> {
    let rate = entry.positive()?;
    match domain {
        Domain::Sampled { period } if rate * period >= PI => Err(entry.error(format!(
            "expected less than pi / sample_time = {:.6} rad/s, found {rate}",
            PI / period
        ))),
        _ => Ok(Bandwidth { rate: Some(rate), is_stated: true }),
    }
}

/// Reads the eigenvalues and checks that they are stable.
fn stable(entry: &Entry<'_>, sampled: bool) -> Result<Vec<Complex<f64>>> {
    let all = eigenvalues(entry)?;
    let unstable =
        |value: &&Complex<f64>| if sampled { value.norm() >= 1.0 } else { value.re >= 0.0 };
    match all.iter().find(unstable) {
        None => Ok(all),
        Some(value) => {
            let rule = if sampled { "a modulus below 1" } else { "a real part below 0" };
            let shown = if value.im == 0.0 { value.re.to_string() } else { value.to_string() };
            Err(entry
                .error(format!("the loop would not be stable: expected {rule}, found {shown}")))
        }
    }
}

/// Reads a list of numbers, and `{ re = -3.0, im = 4.0 }` for complex conjugate pairs.
fn eigenvalues(entry: &Entry<'_>) -> Result<Vec<Complex<f64>>> {
    let mut all = Vec::new();
    for member in entry.list()? {
        if !member.is_table() {
            all.push(Complex::new(member.number()?, 0.0));
            continue;
        }
        let table = member.table()?;
        table.allow(&["re", "im"])?;
        let re = table.require("re", "the real part")?.number()?;
        let im = table.require("im", "the imaginary part")?.positive()?;
        all.extend([Complex::new(re, im), Complex::new(re, -im)]);
    }
    Ok(all)
}

/// Reads a region; in a sampled design a region has a decay rate only.
pub(crate) fn stated_region(entry: &Entry<'_>, sampled: bool) -> Result<Region> {
    if sampled {
        refuse_disc_and_sector(entry)?;
    }
    region(entry)
}

/// Reads a region with at least one of decay, disc and sector.
fn region(entry: &Entry<'_>) -> Result<Region> {
    let table = entry.table()?;
    table.allow(&["decay", "disc", "sector"])?;
    let decay = positive(&table, "decay")?;
    let below = "expected less than 90 degrees";
    let sector = optional(&table, "sector", |entry| positive_within(entry, ..90.0, below))?;
    let disc = optional(&table, "disc", disc)?;
    if decay.is_none() && sector.is_none() && disc.is_none() {
        return Err(entry.error("expected at least one of decay, disc, sector"));
    }
    Ok(Region { decay, disc, sector })
}

/// Reads the centre and the radius of a disc that reaches the left half plane.
fn disc(entry: &Entry<'_>) -> Result<(f64, f64)> {
    let table = entry.table()?;
    table.allow(&["center", "radius"])?;
    let center = table.require("center", "a point of the real axis, 1/s")?;
    let radius = table.require("radius", "in 1/s")?.positive()?;
    match center.number()? {
        number if number < radius => Ok((number, radius)),
        number => Err(center.error(format!(
            "the disc from {} to {} does not reach the left half plane",
            number - radius,
            number + radius
        ))),
    }
}

/// Reads a bound of the norm, or the text "least" (`None`). `remedy`: the entry, if any, that the file needs for
/// "least".
fn bound(entry: &Entry<'_>, remedy: Option<&str>) -> Result<Option<f64>> {
    if !entry.is_text() {
        return entry.positive().map(Some);
    }
    match (entry.text()?, remedy) {
        ("least", None) => Ok(None),
        ("least", Some(remedy)) => Err(entry.error(format!(
            "\"least\" needs {remedy}: without it, ever larger gains lower the norm without end"
        ))),
        (other, _) => Err(entry.error(format!("expected a number or \"least\", found {other:?}"))),
    }
}

/// Largest asymmetry of a weight, relative to its largest entry, that counts as rounding of a matrix product.
const UNSYMMETRIC: f64 = 1e-12;

/// Reads a symmetric matrix, or a list of numbers of at least 0 as a diagonal matrix. A matrix that rounding made
/// unsymmetric becomes the mean of itself and its transpose.
fn weight(entry: &Entry<'_>) -> Result<DMatrix<f64>> {
    let members = entry.list()?;
    if members.iter().any(Entry::is_list) {
        let matrix = matrix(entry)?;
        if !matrix.is_square() {
            let (rows, columns) = matrix.shape();
            return Err(
                entry.error(format!("expected a symmetric matrix, found {rows} x {columns}"))
            );
        }
        let transposed = matrix.transpose();
        let differences = (&matrix - &transposed).abs();
        let (row, column) = differences.iamax_full();
        if differences[(row, column)] > UNSYMMETRIC * matrix.amax() {
            let (row, column) = (row.min(column), row.max(column));
            let [one, other] = [matrix[(row, column)], matrix[(column, row)]];
            return Err(entry.error(format!(
                "expected a symmetric matrix, found [{}, {}] = {one} and [{}, {}] = {other}",
                row + 1,
                column + 1,
                column + 1,
                row + 1
            )));
        }
        return Ok((matrix + transposed) / 2.0);
    }
    let diagonal = members.iter().map(not_negative).collect::<Result<Vec<_>, _>>()?;
    Ok(DMatrix::from_diagonal(&diagonal.into()))
}

impl Region {
    /// Whether an eigenvalue of the loop is in the region. For a sampled loop `value` is in the z-plane, and only the
    /// decay counts.
    #[must_use]
    pub fn contains(self, value: Complex<f64>, domain: Domain) -> bool {
        let decay = self.decay.unwrap_or(0.0);
        if let Domain::Sampled { period } = domain {
            return value.norm() < (-decay * period).exp();
        }
        value.re < -decay
            && self.disc.is_none_or(|(center, radius)| (value - center).norm() < radius)
            && self.sector.is_none_or(|angle| value.im.atan2(-value.re).abs() < angle.to_radians())
    }

    /// Converts the region for the linear matrix inequalities; angles in rad.
    #[must_use]
    pub fn stated(self) -> lmi::Region {
        lmi::Region {
            decay: self.decay,
            disc: self.disc.map(|(center, radius)| lmi::Disc { center, radius }),
            sector: self.sector.map(f64::to_radians),
        }
    }
}
