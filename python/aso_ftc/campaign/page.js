// The text of a script element that the page has compressed: five characters for four bytes, then deflate.
async function unpacked(id) {
  const text = document.getElementById(id).textContent;
  const alphabet = '0123456789ABCDEFGHIJKLMNOPQRSTUVWXYZabcdefghijklmnopqrstuvwxyz!#$%&()*+-;\'=>?@^_`{|}~';
  const digit = new Uint8Array(128);
  for (let k = 0; k < 85; k += 1) digit[alphabet.charCodeAt(k)] = k;
  const whole = Math.ceil(text.length / 5), bytes = new DataView(new ArrayBuffer(4 * whole));
  for (let k = 0; k < whole; k += 1) {
    let value = 0;
    for (let at = 5 * k; at < 5 * k + 5; at += 1) value = 85 * value + (at < text.length ? digit[text.charCodeAt(at)] : 84);
    bytes.setUint32(4 * k, value);
  }
  const length = 4 * whole - (5 * whole - text.length);
  const packed = new Blob([new Uint8Array(bytes.buffer, 0, length)]).stream();
  return new Response(packed.pipeThrough(new DecompressionStream('deflate-raw'))).text();
}
const library = document.createElement('script');
library.textContent = await unpacked('plotly');
document.head.append(library);
const data = JSON.parse(await unpacked('data'));
const byId = id => document.getElementById(id);
const color = name => getComputedStyle(document.documentElement).getPropertyValue('--' + name).trim();
// plotly reads a small HTML in its texts.
const plain = text => String(text).replace(/&/g, '&amp;').replace(/</g, '&lt;').replace(/>/g, '&gt;');
const short = (text, length) => text.length > length ? text.slice(0, length - 1) + '…' : text;
const titled = own => plain(short(own.name + (own.unit ? ' in ' + own.unit : ''), 50));
// More lines than these hide each other.
const LINES = 1500;
const inputs = data.columns.filter(own => own.kind === 'input');
const across = [...inputs, {name: 'run', unit: null, values: data.runs}];
const column = (name, kind) => data.columns.find(own => own.kind === kind && own.name === name);
const status = column('status', 'status'), fault = column('fault', 'fault');
const shown = (own, at) => own.labels ? own.labels[own.values[at]] : own.values[at];
const measure = () => data.measures[byId('measure').value];
const values = () => column(measure().name, 'measure').values;
const inside = (value, {below, above} = measure().limit) => {
  return (below === undefined || value < below) && (above === undefined || value > above);
};
// A run that did not finish fails, also if its measure states a value for that.
const passes = (at, value, limit) => shown(status, at) === 'ok' && inside(value, limit);
// By default plotly.js has a button that uploads the data of a picture.
const options = {displaylogo: false, responsive: true, showSendToCloud: false, plotlyServerURL: '',
  modeBarButtons: [['toImage', 'zoom2d', 'pan2d', 'resetScale2d']]};
function axis(title, more) {
  return {title: {text: title}, gridcolor: color('line'), zerolinecolor: color('line'), linecolor: color('line'),
    automargin: true, ...more};
}
function layout(more) {
  return {paper_bgcolor: 'rgba(0,0,0,0)', plot_bgcolor: 'rgba(0,0,0,0)', height: 420,
    font: {color: color('text'), family: 'system-ui, sans-serif', size: 12},
    hoverlabel: {align: 'left'}, margin: {l: 10, r: 10, t: 30, b: 10}, legend: {orientation: 'h', y: 1.02, yanchor: 'bottom'},
    ...more};
}

function drawBorder() {
  const place = byId('border');
  if (!place) return;
  const {names, surface, measure: of} = data.border, [x, y] = names.map(name => column(name, 'input'));
  const all = column(of, 'measure').values, {limit} = data.measures.find(own => own.name === of);
  const traces = [];
  if (surface) {
    const shades = [[0, color('page')], [1, color('bad')]];
    traces.push({type: 'contour', ...surface, colorscale: shades, zmin: 0, zmax: 1, opacity: 0.45, hoverinfo: 'skip',
      contours: {start: 0.1, end: 0.9, size: 0.1, showlines: false}, colorbar: {title: {text: 'probability', side: 'right'}, thickness: 12}});
    traces.push({type: 'contour', ...surface, showscale: false, hoverinfo: 'skip', line: {color: color('text'), width: 2},
      contours: {type: 'constraint', operation: '=', value: 0.5}, showlegend: false});
  }
  for (const [name, ok, shade, symbol] of [['pass', true, 'good', 'circle'], ['fail', false, 'bad', 'x']]) {
    const rows = data.runs.map((_, at) => at).filter(at => (all[at] !== null && passes(at, all[at], limit)) === ok);
    traces.push({type: 'scatter', mode: 'markers', name, x: rows.map(at => x.values[at]), y: rows.map(at => y.values[at]),
      text: rows.map(at => 'run ' + data.runs[at] + '<br>' + plain(of) + ' = ' + all[at]), hoverinfo: 'text',
      marker: {color: color(shade), size: 5, symbol, opacity: 0.7}});
  }
  Plotly.react(place, traces, layout({hovermode: 'closest', showlegend: true, xaxis: axis(titled(x)), yaxis: axis(titled(y))}), options);
}

function drawIndices() {
  const place = byId('indices'), found = measure().indices;
  if (!place) return;
  place.hidden = !found;
  if (!found) return;
  const traces = found.bars.map((bar, at) => ({type: 'bar', orientation: 'h', name: bar.name,
    y: found.names.map(plain), x: bar.values, marker: {color: color(at ? 'good' : 'low')},
    error_x: bar.confidence ? {array: bar.confidence, color: color('text'), thickness: 1.2} : undefined}));
  Plotly.react(place, traces, layout({height: 110 + 44 * found.names.length,
    xaxis: axis(found.unit ? 'in ' + plain(found.unit) : '', {rangemode: 'tozero'}),
    yaxis: axis('', {autorange: 'reversed', type: 'category'})}), options);
}

function drawParallel() {
  const own = measure(), all = values(), place = byId('parallel');
  if (!place) return;
  if (!document.createElement('canvas').getContext('webgl')) {
    place.textContent = 'This browser has no WebGL, which parallel coordinates need.';
    return;
  }
  const known = data.runs.map((_, at) => at).filter(at => all[at] !== null);
  const count = Math.min(known.length, LINES);
  const rows = Array.from({length: count}, (_, at) => known[Math.floor((at * known.length) / count)]);
  const isPartial = inputs.some(from => rows.some(at => from.values[at] === null) && rows.some(at => from.values[at] !== null));
  byId('parallel-note').textContent = (count < known.length ? 'Of the runs that are drawn below, ' + count
    + ' have a line here. ' : '') + (isPartial ? 'A run without a value of a parameter is at the lower end of its axis.' : '');
  const scaled = value => own.logarithmic ? Math.log10(value) : value;
  const dimension = (from, pick) => {
    const picked = rows.map(pick), finite = picked.filter(value => value !== null);
    let low = finite.reduce((a, b) => Math.min(a, b), Infinity), high = finite.reduce((a, b) => Math.max(a, b), -Infinity);
    if (!(low < high)) { const half = Math.abs(low) / 10 || 1; low -= half; high += half; }
    const label = plain(short(from.name + (from.unit ? ' in ' + from.unit : ''), 26));
    return {label, values: picked.map(value => value === null ? low : value), range: [low, high]};
  };
  const dimensions = inputs.filter(from => rows.some(at => from.values[at] !== null)).map(from => {
    const found = dimension(from, at => from.values[at]);
    if (from.labels && from.labels.length <= 40) Object.assign(found, {range: [-0.5, from.labels.length - 0.5],
      tickvals: from.labels.map((_, at) => at), ticktext: from.labels.map(text => short(text, 26))});
    return found;
  });
  const last = dimension(own, at => scaled(all[at]));
  if (own.logarithmic) last.label = 'log10 of ' + last.label;
  const sorted = last.values.slice().sort((a, b) => a - b), part = p => sorted[Math.floor(p * (sorted.length - 1))];
  const worstLow = own.limit.above !== undefined && own.limit.below === undefined;
  // Within the limit from "low" to "good", outside it "bad"; the worst lines are drawn last.
  const from = part(0.02), to = part(0.98) > from ? part(0.98) : from + 1, limited = Object.keys(own.limit).length > 0;
  const shade = (value, at) => {
    const position = Math.min(Math.max((value - from) / (to - from), 0), 1), bad = worstLow ? 1 - position : position;
    return !limited ? bad : passes(rows[at], all[rows[at]]) ? bad / 2 : 1;
  };
  const shades = last.values.map(shade), order = rows.map((_, at) => at).sort((a, b) => shades[a] - shades[b]);
  const axes = [...dimensions, last].map(one => ({...one, values: order.map(at => one.values[at])}));
  const line = {color: order.map(at => shades[at]), cmin: 0, cmax: 1,
    colorscale: [[0, color('low')], [0.5, color('good')], [1, color('bad')]]};
  if (!rows.length) { Plotly.purge(place); place.textContent = 'No run has a finite value of this measure.'; return; }
  if (!place.data) place.textContent = '';
  place.style.width = Math.max(place.parentElement.clientWidth, 120 * (dimensions.length + 1)) + 'px';
  // The labels of the first axis are left of it.
  const left = Math.max(60, ...(dimensions[0]?.ticktext ?? []).map(text => 15 + 6 * text.length));
  Plotly.react(place, [{type: 'parcoords', dimensions: axes, line, labelangle: -15, labelside: 'top',
    labelfont: {size: 12}, tickfont: {size: 10}, rangefont: {size: 1, color: 'rgba(0,0,0,0)'}}],
    layout({height: 440, margin: {l: left, r: 60, t: 90, b: 20}}), {...options, displayModeBar: false});
}

function drawScatter() {
  const own = measure(), all = values(), from = across[byId('input').value], place = byId('scatter');
  const groups = {good: [], bad: [], none: []};
  data.runs.forEach((_, at) => {
    if (from.values[at] === null) return;
    groups[all[at] === null ? 'none' : passes(at, all[at]) ? 'good' : 'bad'].push(at);
  });
  const finite = all.filter(value => value !== null);
  const top = finite.reduce((a, b) => Math.max(a, b), -Infinity);
  const text = at => 'run ' + data.runs[at] + (fault && shown(fault, at) ? '<br>' + plain(shown(fault, at)) : '')
    + '<br>' + plain(from.name) + ' = ' + plain(shown(from, at))
    + '<br>' + (all[at] === null ? plain(shown(status, at)) + ', no finite value' : plain(own.name) + ' = ' + all[at]);
  const limited = Object.keys(own.limit).length > 0;
  const trace = (rows, name, shade, symbol) => ({type: 'scatter', mode: 'markers', name, customdata: rows,
    x: rows.map(at => from.labels ? plain(shown(from, at)) : from.values[at]),
    y: rows.map(at => all[at] === null ? (finite.length ? top : 1) : all[at]), text: rows.map(text), hoverinfo: 'text',
    marker: {color: color(shade), size: symbol === 'x' ? 8 : 5, symbol, opacity: symbol === 'x' ? 1 : 0.6}});
  const gl = document.createElement('canvas').getContext('webgl') ? 'scattergl' : 'scatter';
  const traces = [[groups.good, limited ? 'within the limit' : 'finished', 'good', 'circle'],
    [groups.bad, limited ? 'outside the limit' : 'not finished', 'bad', 'circle'],
    [groups.none, 'no finite value (at the top)', 'bad', 'x']].filter(one => one[0].length)
    .map(one => ({...trace(...one), type: gl}));
  const shapes = Object.values(own.limit).map(value => ({type: 'line', xref: 'paper', x0: 0, x1: 1, y0: value, y1: value,
    line: {color: color('text'), width: 1.5, dash: 'dash'}}));
  Plotly.react(place, traces, layout({shapes, showlegend: true, hovermode: 'closest',
    xaxis: axis(titled(from), {type: from.labels ? 'category' : '-'}),
    yaxis: axis(titled(own), {type: own.logarithmic ? 'log' : 'linear', exponentformat: 'power'})}), options);
  place.removeAllListeners('plotly_click');
  place.on('plotly_click', event => showRun(event.points[0].customdata));
}

function element(tag, text, parent) {
  const made = document.createElement(tag);
  if (text !== undefined) made.textContent = text;
  if (parent) parent.append(made);
  return made;
}

function showRun(at) {
  const place = byId('point');
  place.textContent = '';
  element('h3', 'Run ' + data.runs[at], place);
  const line = element('div', undefined, place);
  element('code', data.command.join(data.runs[at]), line);
  line.append(' ');
  element('button', 'Copy', line).className = 'copy';
  const list = element('dl', undefined, place);
  for (const own of data.columns) {
    element('dt', own.name + (own.unit ? ' in ' + own.unit : ''), list);
    const value = shown(own, at);
    element('dd', value === null ? 'no finite value' : value, list);
  }
}

function drawHistogram(own, at) {
  const place = byId('histogram-' + at), {edges, counts} = own.histogram;
  const most = counts.reduce((a, b) => Math.max(a, b), 0);
  const text = counts.map((count, bin) => count + ' runs from ' + edges[bin].toPrecision(4) + ' to '
    + edges[bin + 1].toPrecision(4));
  const traces = [{type: 'scatter', mode: 'lines', x: edges, y: [...counts, counts[counts.length - 1]], fill: 'tozeroy',
    line: {shape: 'hv', color: color('good'), width: 1}, text: [...text, ''], hoverinfo: 'text', showlegend: false}];
  for (const [word, value] of Object.entries(own.limit))
    traces.push({type: 'scatter', mode: 'lines', x: [value, value], y: [0, most], hoverinfo: 'text',
      text: word + ' ' + value, line: {color: color('bad'), width: 2, dash: 'dash'}, showlegend: false});
  Plotly.react(place, traces, layout({height: 280, xaxis: axis(titled(own), {type: own.logarithmic ? 'log' : 'linear',
    exponentformat: 'power'}), yaxis: axis('runs', {rangemode: 'tozero'}), margin: {l: 10, r: 10, t: 10, b: 10}}),
    {...options, displayModeBar: false});
}

function drawHeat() {
  const place = byId('heat'), own = measure();
  if (!place) return;
  const {rows, columns, values, lost} = own.heat, names = rows.map(plain), heads = columns.map(plain);
  const lowest = own.limit.above !== undefined && own.limit.below === undefined;
  byId('heat-note').textContent = 'The ' + (lowest ? 'smallest' : 'largest') + ' value of the measure under each fault. '
    + (lost.some(row => row.some(Boolean)) ? 'A cross: a run did not finish or its measure is no number.' : '');
  const label = values.map((row, i) => row.map((value, j) => names[i] + '<br>' + heads[j] + '<br>'
    + (lost[i][j] ? 'a run without value' : value === null ? 'no such run' : plain(own.name) + ' = ' + value)));
  const traces = [{type: 'heatmap', x: heads, y: names, text: label, hoverinfo: 'text', xgap: 1, ygap: 1,
    z: own.logarithmic ? values.map(row => row.map(value => value === null ? null : Math.log10(value))) : values,
    colorscale: [[0, color('low')], [0.5, color('good')], [1, color('bad')]], reversescale: lowest,
    colorbar: {title: {text: (own.logarithmic ? 'log10 of ' : '') + titled(own), side: 'right'}, thickness: 12, exponentformat: 'power'}}];
  const annotations = [];
  lost.forEach((row, i) => row.forEach((flag, j) => flag && annotations.push({x: heads[j], y: names[i], text: '✕',
    showarrow: false, font: {color: color('bad'), size: 16}})));
  place.style.width = Math.max(place.parentElement.clientWidth, 260 + 40 * heads.length) + 'px';
  Plotly.react(place, traces, layout({height: 140 + 26 * rows.length, annotations,
    xaxis: axis('', {type: 'category', showgrid: false}), yaxis: axis('', {type: 'category', autorange: 'reversed',
    showgrid: false})}), {...options, displayModeBar: false});
}

function drawMeasure() {
  const index = Number(byId('measure').value), count = data.measures.length;
  document.querySelectorAll('.of-measure').forEach((block, at) => { block.hidden = at % count !== index; });
  drawIndices(); drawParallel(); drawScatter(); drawHeat();
}
function drawAll() {
  drawBorder();
  data.measures.forEach(drawHistogram);
  if (data.measures.length) drawMeasure();
}

byId('measure')?.addEventListener('change', drawMeasure);
byId('input')?.addEventListener('change', drawScatter);
document.addEventListener('click', event => {
  if (!event.target.classList.contains('copy')) return;
  const button = event.target, code = button.parentElement.querySelector('code');
  const range = document.createRange(), selection = getSelection();
  range.selectNodeContents(code);
  selection.removeAllRanges();
  selection.addRange(range);
  const done = () => { button.textContent = 'Copied'; };
  if (navigator.clipboard) navigator.clipboard.writeText(code.textContent).then(done, () => document.execCommand('copy') && done());
  else if (document.execCommand('copy')) done();
});
matchMedia('(prefers-color-scheme: dark)').addEventListener('change', drawAll);
let pending;
addEventListener('resize', () => {
  clearTimeout(pending);
  pending = setTimeout(() => { if (data.measures.length) { drawParallel(); drawHeat(); } }, 200);
});
drawAll();
document.documentElement.dataset.drawn = 'true';
