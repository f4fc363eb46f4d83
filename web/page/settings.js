"use strict";
// The settings of a run: their fields, the lines for the module, the permalink, the system.toml.

// `at`: "now" changes a run at once, "begin" starts it again. `line`: how the module reads the value.
const FIELDS = [
  { id: "compensate", label: "Compensation", at: "now", value: true, variable: "controller.compensate" },
  { id: "F_c", label: "Coulomb friction F_c", unit: "N", at: "now", value: 25, least: 0, variable: "plant.F_c" },
  { id: "F_s", label: "Static friction F_s", unit: "N", at: "now", value: 30, least: 0, variable: "plant.F_s" },
  { id: "v_s", label: "Stribeck velocity v_s", unit: "m/s", at: "now", value: 0.15, least: 0.001, variable: "plant.v_s" },
  { id: "delta", label: "Stribeck exponent delta", at: "now", value: 2, least: 0.1, variable: "plant.delta" },
  { id: "push", label: "Force of a push", unit: "N", at: "now", value: 40, least: 0 },
  { id: "t_on", label: "Compensation from t_on", unit: "s", at: "begin", value: 40, variable: "controller.t_on" },
  { id: "M", label: "Mass of the cart M", unit: "kg", at: "begin", value: 3.2, least: 0.1, variable: "plant.M" },
  { id: "m", label: "Mass of the pendulum m", unit: "kg", at: "begin", value: 0.535, least: 0.05, variable: "plant.m" },
  { id: "x_p_0", label: "Start position of the cart", unit: "m", at: "begin", value: 0.1, variable: "plant.x_p_0" },
  { id: "theta_0", label: "Start angle of the pendulum", unit: "rad", at: "begin", value: -0.1, variable: "plant.theta_0" },
  { id: "eigenvalues", label: "Eigenvalues of the observer", unit: "1/s", at: "begin", value: "-1200 -1500 -1800 -2100 -3000", list: true },
  { id: "step", label: "Step size", unit: "s", at: "begin", value: 0.001, least: 0.00005 },
  { id: "stop", label: "Stop time", unit: "s", at: "begin", value: 100, least: 1 },
  { id: "noise_x", label: "Noise of x_p", unit: "m", at: "begin", value: 0, least: 0, fault: "noise controller.x_p" },
  { id: "noise_theta", label: "Noise of theta", unit: "rad", at: "begin", value: 0, least: 0, fault: "noise controller.theta" },
  { id: "delay_x", label: "Delay of x_p", unit: "s", at: "begin", value: 0, least: 0, fault: "delay controller.x_p" },
  { id: "delay_theta", label: "Delay of theta", unit: "s", at: "begin", value: 0, least: 0, fault: "delay controller.theta" },
  { id: "bias_x", label: "Sensor fault: x_p is off by", unit: "m", at: "begin", value: 0, fault: "bias controller.x_p" },
  { id: "bias_theta", label: "Sensor fault: theta is off by", unit: "rad", at: "begin", value: 0, fault: "bias controller.theta" },
  { id: "gain_u", label: "Actuator fault: part of the command that acts", at: "begin", value: 1, fault: "gain plant.u" },
  { id: "from", label: "Time of these faults", unit: "s", at: "begin", value: 60, least: 0 },
];
const DEFAULTS = Object.fromEntries(FIELDS.map(({ id, value }) => [id, value]));
const DESIGNED = DEFAULTS.eigenvalues;

// The value of a field, or a sentence.
function checked(field, text) {
  if (typeof field.value === "boolean" || field.list) return text;
  const value = Number(text);
  if (text === "" || !Number.isFinite(value)) throw new Error(`${field.label}: expected a number, found "${text}"`);
  if (field.least !== undefined && value < field.least) {
    throw new Error(`${field.label} = ${value}: expected at least ${field.least} ${field.unit ?? ""}`);
  }
  return value;
}

// The faults that act, bias and gain first, as the module orders them.
function faults(values) {
  const order = ["bias", "gain", "delay", "noise"];
  const neutral = ({ fault }) => (fault.startsWith("gain") ? 1 : 0);
  return FIELDS.filter((field) => field.fault && values[field.id] !== neutral(field))
    .map((field) => ({ ...field, kind: field.fault.split(" ")[0], input: field.fault.split(" ")[1] }))
    .sort((a, b) => a.input.localeCompare(b.input) || order.indexOf(a.kind) - order.indexOf(b.kind));
}

// The lines for the module, of the values at the start of the run.
function lines(values) {
  const own = FIELDS.filter(({ id, variable, value }) => variable && values[id] !== value);
  return [
    `from=${values.from}`,
    ...own.map(({ id, variable }) => `${variable}=${values[id]}`),
    ...faults(values).map(({ fault, id }) => `${fault}=${values[id]}`),
  ].join("\n");
}

// The eigenvalues of the observer, if they are not those of the paper.
function placed(values) {
  return values.eigenvalues.trim() === DESIGNED ? null : values.eigenvalues;
}

function permalink(values) {
  const changed = FIELDS.filter(({ id, value }) => values[id] !== value);
  return `#${new URLSearchParams(changed.map(({ id }) => [id, values[id]]))}`;
}

// The values of a permalink; entries that are unknown or no numbers are left out.
function fromLink(hash) {
  const values = { ...DEFAULTS };
  const left = [];
  for (const [id, text] of new URLSearchParams(hash.replace(/^#/, ""))) {
    const field = FIELDS.find((known) => known.id === id);
    try {
      if (!field) throw new Error(`unknown setting ${id}`);
      values[id] = typeof field.value === "boolean" ? text === "true" : checked(field, text);
    } catch (error) {
      left.push(error.message);
    }
  }
  return { values, left };
}

function faultTable({ kind, input, id }, values) {
  const value = values[id];
  const what = {
    bias: `{ value = ${value}, from = ${values.from} }`,
    gain: `{ factor = ${value}, from = ${values.from} }`,
    delay: `{ seconds = ${value} }`,
    noise: `{ deviation = ${value} }`,
  }[kind];
  return `[[scenario.fault]]\nconnection = "${input}"\n${kind} = ${what}\n`;
}

// The system.toml of a run: `gains` and `changes` as the run has them.
function systemToml(values, gains, changes) {
  const settings = FIELDS.filter(({ id, variable, value }) => variable && values[id] !== value)
    .map(({ id, variable }) => `"${variable}" = ${values[id]}`);
  settings.push(...gains.split("\n").filter(Boolean).map((line) => {
    const [name, value] = line.split("=");
    return `"${name}" = ${value}`;
  }));
  return [
    '[fmus]\nplant = "dist/FrictionPendulum.fmu"\ncontroller = "dist/AsoController.fmu"\n',
    settings.length > 0 ? `[settings]\n${settings.join("\n")}\n` : "",
    `[algorithm]\nstep = ${values.step}\n`,
    `[experiment]\nstop-time = ${values.stop}\n`,
    ...faults(values).map((fault) => faultTable(fault, values)),
    ...changes.map(({ variable, at, value }) =>
      `[[scenario.set]]\nvariable = "${variable}"\nat = ${at}\nvalue = ${value}\n`),
  ].filter(Boolean).join("\n");
}
