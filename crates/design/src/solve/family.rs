//! The members of a family of plants that one controller serves.

use control::hold::zero_order_hold;
use control::lmi::{self, CommonFeedback, Outcome, RegionCertificate, Vertex};
use control::{Domain, Error};
use files::PlaceError;

use crate::plant::linear::{AT_REST, LinearPlant};
use crate::solve::gain::{GainResult, Refusal, unique};
use crate::solve::tracking::{check_member, feedback_pair};
use plant_file::PlantFile;
use plant_file::references::References;
use plant_file::requirements::Region;
use plant_file::signals::signal_names;
use plant_file::variants::Variant;

/// The name of the plant of the file among the members.
pub(crate) const NOMINAL: &str = "nominal";

/// The family of a design.
pub(crate) struct Family {
    /// The members besides the plant of the file.
    pub(crate) members: Vec<Member>,
    /// One P for all state feedback loops, if the feedback was designed for all members.
    pub(crate) feedback: Option<RegionCertificate>,
}

/// A plant and its name.
pub(crate) struct Member {
    pub(crate) name: String,
    pub(crate) linear: LinearPlant,
}

/// Returns the members that the file states besides its own plant `nominal`; a member that is not at
/// rest at its operating point is a warning.
pub(crate) fn members(
    file: &PlantFile<'_>,
    nominal: &LinearPlant,
    warnings: &mut Vec<PlaceError>,
) -> Result<Vec<Member>, crate::Error> {
    let mut member = |variant: &Variant| {
        let linear = LinearPlant::of(&file.with(variant))
            .map_err(|error| error.within(format!("member `{}` of the family", variant.name)))?;
        check_states(file, variant, nominal, &linear)?;
        if linear.has_feedthrough() {
            let message = "a measurement depends on a command directly (D is not 0); expected members \
                           without direct feedthrough";
            return Err(file.error_at(&variant.place, message).into());
        }
        check_member(file, variant, &linear)?;
        if linear.residual.is_some_and(|residual| residual >= AT_REST) {
            let message = format!(
                "the operating point is no equilibrium of the member `{}`: what accelerates it there \
                 acts like a constant fault",
                variant.name
            );
            warnings.push(file.error_at(&variant.place, message));
        }
        Ok(Member { name: variant.name.clone(), linear })
    };
    file.family.iter().map(&mut member).collect()
}

/// Checks that a variant has the states of the plant of the file.
pub(crate) fn check_states(
    file: &PlantFile<'_>,
    variant: &Variant,
    nominal: &LinearPlant,
    linear: &LinearPlant,
) -> Result<(), PlaceError> {
    let (expected, states) = (signal_names(&nominal.states), signal_names(&linear.states));
    if expected == states {
        return Ok(());
    }
    let message =
        format!("expected the states of the plant of the file, {expected}; found {states}");
    Err(file.error_at(&variant.place, message))
}

/// Computes one K_x for the nominal plant and all members, with its certificate; with integral action one K = [K_x,
/// K_i] for all plants with their integrals.
pub(crate) fn common_feedback(
    nominal: &LinearPlant,
    members: &[Member],
    references: Option<&References>,
    region: Region,
    domain: Domain,
) -> Result<(GainResult, RegionCertificate), Refusal> {
    let all = std::iter::once(nominal).chain(members.iter().map(|member| &member.linear));
    let plants =
        all.map(|plant| vertex(plant, references, domain)).collect::<Result<Vec<_>, _>>()?;
    let stated = region.stated();
    match lmi::common_feedback(&plants, &stated, domain)? {
        Outcome::Optimal(CommonFeedback { gain, certificate, .. }) => {
            let method = format!(
                "One gain for the {} plants of the family by linear matrix inequalities; region \
                 verified for all of them with one P and margin {:.1e}.",
                plants.len(),
                certificate.margin
            );
            Ok((unique(gain, method), certificate))
        }
        Outcome::Infeasible { conflict } => {
            let names: Vec<_> = conflict.iter().map(|&at| name(members, at)).collect();
            let scaling = lmi::largest_scaling(&plants, &stated, domain)?;
            Err(Refusal::Conflict(refusal(&names, scaling)))
        }
        Outcome::Inconclusive(reason) => Err(Refusal::Conflict(format!(
            "no gain for all members of the family could be verified: {reason}; another region, or \
             units nearer to the size of the signals may help"
        ))),
    }
}

fn vertex(
    plant: &LinearPlant,
    references: Option<&References>,
    domain: Domain,
) -> Result<Vertex, Error> {
    let (a, b) = match domain {
        Domain::Continuous => (plant.a.clone(), plant.b.clone()),
        Domain::Sampled { period } => zero_order_hold(&plant.a, &plant.b, period)?,
    };
    let (a, b) = feedback_pair(references, [&a, &b, &plant.c], domain)?;
    Ok(Vertex { a, b })
}

/// Returns the name of the plant at a position: 0 is the nominal plant, 1 the first of `members`.
pub(crate) fn name(members: &[Member], at: usize) -> &str {
    at.checked_sub(1).map_or(NOMINAL, |at| &members[at].name)
}

/// Returns the sentence about a family without a common gain; `names`: members that have none together, `scaling`: the
/// size of the largest family with one.
fn refusal(names: &[&str], scaling: Option<f64>) -> String {
    let names = names.join(", ");
    match scaling {
        None => {
            format!("no gain places the eigenvalues of the nominal plant in the region ({names})")
        }
        Some(scaling) => format!(
            "no gain with one Lyapunov matrix places the eigenvalues of all members in the region: {names} \
             have none together. The largest family for which one was found has {scaling:.2} of the \
             distances from the nominal plant; expected members nearer to it, or a larger region"
        ),
    }
}
