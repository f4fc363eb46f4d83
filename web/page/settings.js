"use strict";
// The settings of a run: their fields and rules, the lines for the module, the link, the system.toml.

// `at`: "now" changes a run at once, "begin" starts it again. `fmu`: the start value in the FMU, if it differs.
// `slide`: ends and step of the slider. `part`: the group of fields in the form.
const FIELDS = [
  { id: "compensate", label: "Compensate", at: "now", value: true, variable: "controller.compensate" },
  { id: "F_c", label: "Coulomb friction F_c", unit: "N", at: "now", part: "friction", value: 25, least: 0, variable: "plant.F_c", slide: [0, 60, 0.5] },
  { id: "F_s", label: "Static friction F_s", unit: "N", at: "now", part: "friction", value: 30, least: 0, variable: "plant.F_s", slide: [0, 60, 0.5] },
  { id: "v_s", label: "Stribeck velocity v_s", unit: "m/s", at: "now", part: "friction", value: 0.15, least: 0.001, variable: "plant.v_s", slide: [0.01, 0.5, 0.01] },
  { id: "delta", label: "Stribeck exponent delta", at: "now", part: "friction", value: 2, least: 0.1, variable: "plant.delta", slide: [0.5, 4, 0.1] },
  { id: "push", label: "Force of a push", unit: "N", at: "now", part: "friction", value: 40, least: 0, slide: [0, 100, 1] },
  { id: "t_on", label: "Compensation from t_on", unit: "s", at: "begin", part: "loop", value: 40, variable: "controller.t_on", slide: [0, 100, 1] },
  { id: "monitor", label: "Estimate the friction before t_on too", at: "begin", part: "loop", value: true, fmu: false, variable: "controller.monitor" },
  { id: "M", label: "Mass of the cart M", unit: "kg", at: "begin", part: "loop", value: 3.2, least: 0.1, variable: "plant.M", slide: [1, 8, 0.1] },
  { id: "m", label: "Mass of the pendulum m", unit: "kg", at: "begin", part: "loop", value: 0.535, least: 0.05, variable: "plant.m", slide: [0.05, 1.4, 0.005] },
  { id: "x_p_0", label: "Start position of the cart", unit: "m", at: "begin", part: "loop", value: 0.1, least: -10, most: 10, variable: "plant.x_p_0", slide: [-1, 1, 0.01] },
  { id: "theta_0", label: "Start angle of the pendulum", unit: "rad", at: "begin", part: "loop", value: -0.1, least: -3.2, most: 3.2, variable: "plant.theta_0", slide: [-0.5, 0.5, 0.01] },
  { id: "eigenvalues", label: "Eigenvalues of the observer", unit: "1/s", at: "begin", part: "loop", value: "-1200 -1500 -1800 -2100 -3000", list: true },
  { id: "step", label: "Step size", unit: "s", at: "begin", part: "loop", value: 0.001, least: 0.00005, most: 1 },
  { id: "stop", label: "Stop time", unit: "s", at: "begin", part: "loop", value: 100, least: 1, slide: [10, 300, 10] },
  { id: "from", label: "The faults act from", unit: "s", at: "begin", part: "faults", value: 60, least: 0, slide: [0, 100, 1] },
  { id: "noise_x", label: "Noise of x_p", unit: "m", at: "begin", part: "faults", value: 0, least: 0, fault: "noise controller.x_p", slide: [0, 0.0001, 0.000001] },
  { id: "noise_theta", label: "Noise of theta", unit: "rad", at: "begin", part: "faults", value: 0, least: 0, fault: "noise controller.theta", slide: [0, 0.0001, 0.000001] },
  { id: "delay_x", label: "Delay of x_p", unit: "s", at: "begin", part: "faults", value: 0, least: 0, fault: "delay controller.x_p", slide: [0, 0.005, 0.0001] },
  { id: "delay_theta", label: "Delay of theta", unit: "s", at: "begin", part: "faults", value: 0, least: 0, fault: "delay controller.theta", slide: [0, 0.005, 0.0001] },
  { id: "bias_x", label: "x_p is measured too large by", unit: "m", at: "begin", part: "faults", value: 0, fault: "bias controller.x_p", slide: [-0.1, 0.1, 0.001] },
  { id: "bias_theta", label: "theta is measured too large by", unit: "rad", at: "begin", part: "faults", value: 0, fault: "bias controller.theta", slide: [-0.05, 0.05, 0.001] },
  { id: "gain_u", label: "Part of the command that acts", at: "begin", part: "faults", value: 1, fault: "gain plant.u", slide: [0, 1.5, 0.01] },
];
const DEFAULTS = Object.fromEntries(FIELDS.map(({ id, value }) => [id, value]));
const DESIGNED = DEFAULTS.eigenvalues;
const NUMBER = /^[-+]?(\d+\.?\d*|\.\d+)(e[-+]?\d+)?$/i; // as the module reads it
const MOST_STEPS = 1e8;
const MOST_DELAY = 250000; // communication steps
const [J, L] = [0.062, 0.365]; // of the pendulum: moment of inertia in kg m^2, distance of the centre of mass in m
const LONGEST_LINK = 8000; // characters

// The gains that the paper prints, with the signs of L[3,2] and L[4,2] reversed: as printed, the observer is unstable.
const PRINTED = [[38, -4.8], [-3.8, 51.8], [379.2, 169], [-129.7, 884.1], [-3343.2, 894.1]]
  .flatMap((row, i) => row.map((value, j) => `controller.${i < 4 ? `L_x[${i + 1}` : "L_f[1"},${j + 1}]=${value}\n`)).join("");

const PRESETS = [
  { label: "The paper", values: {},
    text: "The experiment of the paper: compensation from 40 s on. The estimate already runs before; nobody uses it yet." },
  { label: "The paper, to the letter", values: { monitor: false },
    text: "The controller holds f_hat at 0 until 40 s, as in the paper. What follows is the same." },
  { label: "A delay beyond the margin of 2.03 ms", values: { delay_x: 0.0025, delay_theta: 0.0025, from: 41 },
    text: "From 41 s on both measurements are 2.5 ms late. The margin of the design is 2.03 ms: the cart is lost at once." },
  { label: "Half the friction", values: { F_c: 12.5, F_s: 15 }, text: "The controller does not know that the friction is half as large, and needs not: it estimates it." },
  { label: "The gains as printed", values: { eigenvalues: "printed", monitor: false },
    text: "The observer gains that the paper prints, with two signs corrected. They do not have the printed eigenvalues: the cart is lost soon after 40 s." },
  { label: "Sensor fault", values: { bias_theta: 0.01, from: 60 },
    text: "From 60 s on theta is measured 0.01 rad too large. The observer takes this for friction, and the cart moves to another place." },
];

const unit = (field) => (field.unit ? ` ${field.unit}` : "");

// The value that a text states, or an error.
function parsed(field, text) {
  if (typeof field.value === "boolean") return text === true || text === "true";
  if (field.list) return text.trim();
  if (/^[^,]*\d,\d+$/.test(text)) throw new Error(`${field.label}: expected a decimal point, found "${text}"`);
  if (!NUMBER.test(text) || !Number.isFinite(Number(text))) throw new Error(`${field.label}: expected a number such as ${field.value}, found "${text}"`);
  const value = Number(text);
  if (value < field.least) throw new Error(`${field.label} = ${value}: expected at least ${field.least}${unit(field)}`);
  if (value > field.most) throw new Error(`${field.label} = ${value}: expected at most ${field.most}${unit(field)}`);
  return value;
}

// Why the plant or the master would refuse these values: fields and a sentence; null if they do not.
function conflict({ F_c, F_s, M, m, step, stop, delay_x, delay_theta }) {
  const most = (J + Math.sqrt(J * J + 4 * L * L * M * J)) / (2 * L * L); // (M + m) J > (m l)^2
  const delay = Math.max(delay_x, delay_theta);
  const rules = [
    [F_s < F_c, ["F_c", "F_s"], `Friction F_c = ${F_c} N, F_s = ${F_s} N: expected F_s at least as large as F_c`],
    [m > most * (1 - 1e-9), ["m", "M"], `Mass of the pendulum m = ${m} kg: expected below ${most.toFixed(3)} kg for a cart of ${M} kg; the page keeps the moment of inertia, ${J} kg m²`],
    [stop / step >= MOST_STEPS, ["stop", "step"], `${stop} s in steps of ${step} s: expected fewer than 100 million steps`],
    [delay / step > MOST_DELAY, ["delay_x", "delay_theta", "step"], `A delay of ${delay} s: expected at most ${MOST_DELAY} steps of ${step} s`],
  ];
  const [, ids, text] = rules.find(([broken]) => broken) ?? [];
  return text ? { ids, text } : null;
}

// The values with another one in a field, or an error.
function changed(values, field, text) {
  const next = { ...values, [field.id]: parsed(field, text) };
  const clash = conflict(next);
  if (clash?.ids.includes(field.id)) throw new Error(clash.text);
  return next;
}

// The faults that act, bias and gain first, as the module orders them.
function faults(values) {
  const order = ["bias", "gain", "delay", "noise"];
  const neutral = ({ fault }) => (fault.startsWith("gain") ? 1 : 0);
  return FIELDS.filter((field) => field.fault && values[field.id] !== neutral(field))
    .map((field) => ({ ...field, kind: field.fault.split(" ")[0], input: field.fault.split(" ")[1] }))
    .sort((a, b) => a.input.localeCompare(b.input) || order.indexOf(a.kind) - order.indexOf(b.kind));
}

// The fields of variables whose values are not those of the FMU.
function stated(values) {
  return FIELDS.filter(({ id, variable, value, fmu = value }) => variable && values[id] !== fmu);
}

// The lines for the module, of the values at the start of the run.
function lines(values) {
  return [
    `from=${values.from}`,
    ...stated(values).map(({ id, variable }) => `${variable}=${values[id]}`),
    ...faults(values).map(({ fault, id }) => `${fault}=${values[id]}`),
  ].join("\n");
}

// The eigenvalues of the observer, if they are to be placed, and the gains, if those are stated.
function observer({ eigenvalues }) {
  if (/^(as )?printed$/i.test(eigenvalues)) return { eigenvalues: null, gains: PRINTED };
  return { eigenvalues: eigenvalues === DESIGNED ? null : eigenvalues, gains: "" };
}

// The name in a link of a variable that changes during a run.
const CHANGEABLE = new Map([["plant.f_a", "f_a"], ...FIELDS.filter(({ at, variable }) => at === "now" && variable).map(({ id, variable }) => [variable, id])]);

// A link to a run: its values at the start and its changes, and the number of changes that have no room.
function permalink(values, changes) {
  const parts = FIELDS.filter(({ id, value }) => values[id] !== value).map(({ id }) => [id, values[id]]);
  const moves = changes.map(({ variable, at, value }) => ["change", `${at}*${CHANGEABLE.get(variable)}*${value}`]);
  const whole = `#${new URLSearchParams([...parts, ...moves])}`;
  if (whole.length <= LONGEST_LINK) return { link: whole, without: 0 };
  return { link: `#${new URLSearchParams([...parts, ["without", moves.length]])}`, without: moves.length };
}

// A change in a link: time, name, value.
function move(text) {
  const [at, id, value] = text.split("*");
  const variable = [...CHANGEABLE].find(([, known]) => known === id)?.[0];
  const field = FIELDS.find((known) => known.id === id) ?? { label: "Push", value: 0 };
  if (!variable || !NUMBER.test(at) || value === undefined) throw new Error(`the change "${text}" is not understood`);
  return { variable, at: Number(at), value: parsed(field, value) };
}

// The values and changes of a link, and sentences about what is not restored.
function fromLink(hash) {
  let values = { ...DEFAULTS };
  const left = [];
  const changes = [];
  for (const [id, text] of new URLSearchParams(hash.replace(/^#/, ""))) {
    const field = FIELDS.find((known) => known.id === id);
    try {
      if (id === "change") changes.push(move(text));
      else if (id === "without") left.push(`${text} changes made during the run, too many for a link`);
      else if (!field) throw new Error(`unknown setting ${id}`);
      else values[id] = parsed(field, text);
    } catch (error) {
      left.push(error.message);
    }
  }
  for (let clash = conflict(values); clash; clash = conflict(values)) {
    left.push(clash.text);
    values = { ...values, ...Object.fromEntries(clash.ids.map((id) => [id, DEFAULTS[id]])) };
  }
  return { values, changes: changes.sort((a, b) => a.at - b.at), left };
}

function faultTable({ kind, input, id }, values) {
  const name = { bias: "value", gain: "factor", delay: "seconds", noise: "deviation" }[kind];
  return `[[scenario.fault]]\nconnection = "${input}"\n${kind} = { ${name} = ${values[id]}, from = ${values.from} }\n`;
}

// The system.toml of a run: `gains` and `changes` as the run has them.
function systemToml(values, gains, changes) {
  const settings = stated(values).map(({ id, variable }) => `"${variable}" = ${values[id]}`);
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
