//! Scenarios read from a file, with slaves that record the calls they receive.
#![expect(clippy::unwrap_used, clippy::float_cmp, reason = "tests; exact by construction")]

mod drives;
mod examples;
mod faults;
mod refusals;

use std::path::Path;
use std::sync::{Arc, Mutex};

use fmu_description::ModelDescription;
use master::{CallError, Slave, StepResult, System};
use study::scenario::{ResolvedScenario, Scenario, ScenarioError, Setup};

/// The recorded calls of a slave: function, value references, values.
type Calls = Arc<Mutex<Vec<String>>>;

/// A slave that records the values set.
struct Listener {
    description: ModelDescription,
    calls: Calls,
}

impl Listener {
    fn note(&self, function: &str, references: &[u32], values: impl std::fmt::Debug) {
        self.calls.lock().unwrap().push(format!("{function} {references:?} {values:?}"));
    }
}

impl Slave for Listener {
    fn description(&self) -> &ModelDescription {
        &self.description
    }
    fn get_real(&mut self, _: &[u32], values: &mut [f64]) -> Result<(), CallError> {
        values.fill(0.0);
        Ok(())
    }
    fn set_real(&mut self, references: &[u32], values: &[f64]) -> Result<(), CallError> {
        self.note("real", references, values);
        Ok(())
    }
    fn set_integer(&mut self, references: &[u32], values: &[i64]) -> Result<(), CallError> {
        self.note("integer", references, values);
        Ok(())
    }
    fn set_boolean(&mut self, references: &[u32], values: &[i32]) -> Result<(), CallError> {
        self.note("boolean", references, values);
        Ok(())
    }
    fn set_string(&mut self, references: &[u32], values: &[String]) -> Result<(), CallError> {
        self.note("string", references, values);
        Ok(())
    }
    fn set_input_derivatives(
        &mut self,
        references: &[u32],
        orders: &[i32],
        values: &[f64],
    ) -> Result<(), CallError> {
        assert!(orders.iter().all(|&order| order == 1));
        self.note("derivative", references, values);
        Ok(())
    }
    fn do_step(&mut self, _: f64, _: f64, _: bool) -> Result<StepResult, CallError> {
        Ok(StepResult::Whole)
    }
}

fn variable(name: &str, reference: u32, attributes: &str, kind: &str) -> String {
    format!(
        r#"<ScalarVariable name="{name}" valueReference="{reference}" {attributes}>{kind}</ScalarVariable>"#
    )
}

/// A slave with a variable of each sort; `interpolates` is `canInterpolateInputs`.
fn listener(interpolates: bool) -> (Box<dyn Slave>, Calls) {
    let (input, discrete) = ("causality=\"input\"", "causality=\"input\" variability=\"discrete\"");
    let parameter = |variability| format!("causality=\"parameter\" variability=\"{variability}\"");
    let variables = [
        variable("force", 1, input, r#"<Real start="0" unit="N"/>"#),
        variable("angle", 2, input, r#"<Real start="0" declaredType="Angle"/>"#),
        variable("level", 3, discrete, r#"<Real start="0"/>"#),
        variable("count", 4, discrete, r#"<Integer start="0"/>"#),
        variable("gear", 5, discrete, r#"<Enumeration start="1" declaredType="Gear"/>"#),
        variable("on", 6, discrete, r#"<Boolean start="false"/>"#),
        variable("mode", 7, discrete, r#"<String start="idle"/>"#),
        variable("F_c", 8, &parameter("tunable"), r#"<Real start="5" unit="N"/>"#),
        variable("mass", 9, &parameter("fixed"), r#"<Real start="1" unit="kg"/>"#),
        variable("y", 10, "causality=\"output\"", "<Real/>"),
        variable("n", 11, "causality=\"output\" variability=\"discrete\"", "<Integer/>"),
        variable("temperature", 12, input, r#"<Real start="0" unit="degC"/>"#),
    ]
    .concat();
    let xml = format!(
        r#"<fmiModelDescription fmiVersion="2.0" modelName="Listener" guid="g">
        <CoSimulation modelIdentifier="L" canInterpolateInputs="{interpolates}"/>
        <UnitDefinitions>
        <Unit name="N"><BaseUnit kg="1" m="1" s="-2"/></Unit>
        <Unit name="kg"><BaseUnit kg="1"/></Unit>
        <Unit name="rad"><BaseUnit rad="1"/></Unit>
        <Unit name="degC"><BaseUnit K="1" offset="273.15"/></Unit>
        </UnitDefinitions>
        <TypeDefinitions><SimpleType name="Gear"><Enumeration>
        <Item name="reverse" value="-1"/><Item name="first" value="1"/><Item name="second" value="2"/>
        </Enumeration></SimpleType>
        <SimpleType name="Angle"><Real unit="rad"/></SimpleType></TypeDefinitions>
        <ModelVariables>{variables}</ModelVariables><ModelStructure><Outputs>
        <Unknown index="10"/><Unknown index="11"/></Outputs></ModelStructure>
        </fmiModelDescription>"#
    );
    let calls = Calls::default();
    let description = ModelDescription::parse(xml).unwrap();
    (Box::new(Listener { description, calls: calls.clone() }), calls)
}

/// `plant`, which takes input derivatives, and `ctrl`, which does not; `ctrl.force`, `ctrl.count` and
/// `ctrl.angle` are connected.
fn system() -> (System, Calls, Calls) {
    let ((plant, plant_told), (ctrl, ctrl_told)) = (listener(true), listener(false));
    let mut system = System::default();
    system.add("plant", plant).unwrap();
    system.add("ctrl", ctrl).unwrap();
    system.connect("plant.y", "ctrl.force").unwrap();
    system.connect("plant.y", "ctrl.angle").unwrap();
    system.connect("plant.n", "ctrl.count").unwrap();
    (system, plant_told, ctrl_told)
}

/// An FMU of FMI 3.0, called fmu, with inputs of several widths, one that is a difference of temperatures, and an
/// output.
fn of_fmi_3() -> (System, Calls) {
    let xml = r#"<fmiModelDescription fmiVersion="3.0" modelName="Listener" instantiationToken="t">
        <CoSimulation modelIdentifier="L"/>
        <UnitDefinitions><Unit name="m"><BaseUnit m="1"/></Unit></UnitDefinitions>
        <TypeDefinitions><EnumerationType name="Size"><Item name="small" value="1"/>
        <Item name="huge" value="1099511627776"/><Item name="beyond" value="9007199254740993"/>
        </EnumerationType></TypeDefinitions>
        <ModelVariables>
        <Float64 name="time" valueReference="0" causality="independent"/>
        <Int8 name="small" valueReference="1" causality="input" start="0"/>
        <UInt32 name="large" valueReference="2" causality="input" start="0"/>
        <Int64 name="wide" valueReference="3" causality="input" start="0"/>
        <Float32 name="single" valueReference="4" causality="input" unit="m" start="0">
        <Alias name="also single"/></Float32>
        <Float64 name="rise" valueReference="5" causality="input" unit="degC" relativeQuantity="true"
        start="0"/>
        <Enumeration name="size" valueReference="6" causality="input" declaredType="Size" start="1"/>
        <Float64 name="y" valueReference="7" causality="output"><Alias name="also y"/></Float64>
        </ModelVariables><ModelStructure><Output valueReference="7"/></ModelStructure>
        </fmiModelDescription>"#;
    let (description, calls) = (ModelDescription::parse(xml).unwrap(), Calls::default());
    let mut system = System::default();
    system.add("fmu", Box::new(Listener { description, calls: calls.clone() })).unwrap();
    (system, calls)
}

/// A complete file.
#[derive(serde::Deserialize, serde::Serialize)]
struct Document {
    scenario: Scenario,
}

fn scenario(text: &str) -> Scenario {
    toml::from_str::<Document>(text).unwrap_or_else(|error| panic!("{error}\n{text}")).scenario
}

/// The run starts at 0 s with steps of 0.5 s.
fn setup(folder: &Path) -> Setup<'_> {
    Setup { folder, start: 0.0, step: 0.5, tables: &[] }
}

fn resolve(text: &str) -> Result<ResolvedScenario, ScenarioError> {
    scenario(text).resolve(&system().0, &setup(Path::new(".")))
}
