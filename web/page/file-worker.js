// Reads a results file. Messages in: {kind: "open", file}, {kind: "read", name}. Messages out: {kind: "opened", time, names,
// units, count, remark}, {kind: "values", values}, {kind: "progress", part}, {kind: "refused", text}. A gap is NaN.
let table = null; // {read: a function from a name to numbers}

// The places of a separator outside of quotes.
function cells(line, separator) {
  if (!line.includes('"')) return line.split(separator);
  const parts = [""];
  let isQuoted = false;
  for (const letter of line) {
    if (letter === '"') isQuoted = !isQuoted;
    if (letter === separator && !isQuoted) parts.push("");
    else parts[parts.length - 1] += letter;
  }
  return parts.map((part) => part.trim().replace(/^"|"$/g, "").replaceAll('""', '"'));
}

const WORDS = { true: 1, false: 0, True: 1, False: 0, TRUE: 1, FALSE: 0 };

// The number of a cell; NaN for a gap or a text.
function number(cell, isComma) {
  if (cell.trim() === "") return NaN;
  const value = Number(isComma ? cell.replace(",", ".") : cell);
  return value === value ? value : WORDS[cell.trim()] ?? NaN;
}

// The time of a cell: a number in s, or a date of ISO 8601 in s since 1970, in UTC unless it states an offset. Date.parse
// rounds to ms.
function instant(cell, isComma) {
  const date = /^(\d{4}-\d\d-\d\d)(?:[T ](\d\d:\d\d(?::\d\d)?)(\.\d+)?)?(?:([+-]\d\d):?(\d\d)|Z)?$/i.exec(cell.trim());
  if (!date) return number(cell, isComma);
  const [, day, clock = "00:00", part = "", hours = "+00", minutes = "00"] = date;
  return Date.parse(`${day}T${clock}${hours}:${minutes}`) / 1000 + Number(`0${part}`);
}

// Names the columns without numbers.
function remarkOn(names) {
  const more = names.length > 10 ? ` and ${names.length - 10} more` : "";
  return names.length > 0 ? ` Columns without numbers are left out: ${names.slice(0, 10).join(", ")}${more}.` : "";
}

// The most frequent of tab, semicolon and comma.
function separatorOf(header) {
  return ["\t", ";", ","].map((letter) => [cells(header, letter).length, letter]).sort(([a], [b]) => b - a)[0][1];
}

async function openCsv(file, begin) {
  const marks = { "255,254": "utf-16le", "254,255": "utf-16be" };
  const decoder = new TextDecoder(marks[`${begin[0]},${begin[1]}`] ?? "utf-8");
  const isZipped = begin[0] === 0x1f && begin[1] === 0x8b;
  if (!isZipped && decoder.encoding === "utf-8" && begin.includes(0)) {
    throw new Error("it is neither text nor Parquet. This page reads CSV and Parquet files; aso-ftc report reads other kinds.");
  }
  let count = 0;
  let done = 0;
  const counted = new TransformStream({ transform: (part, control) => {
    done += part.length;
    control.enqueue(part);
  } });
  let bytes = file.stream().pipeThrough(counted);
  if (isZipped) bytes = bytes.pipeThrough(new DecompressionStream("gzip"));
  const source = bytes.getReader();
  let [names, separator, isComma, units, columns, place] = [null, ",", false, {}, [], 0];
  let lineNumber = 0;
  let before = -Infinity;
  const take = (line) => {
    lineNumber += 1;
    if (line.trim() === "") return;
    if (!names) {
      separator = separatorOf(line);
      isComma = separator !== ",";
      names = cells(line, separator).map((name) => name.trim());
      if (names.length < 2) throw new Error(`line ${lineNumber}: expected a header with the time and variables, separated by commas, semicolons or tabs; found "${line.slice(0, 60)}"`);
      place = Math.max(names.findIndex((name) => /^(time|t)$/i.test(name)), 0);
      columns = names.map(() => new Float64Array(1024));
      return;
    }
    const parts = cells(line, separator);
    if (parts.length !== names.length) {
      const advice = separator === "," && parts.length > names.length ? "; numbers with decimal commas need semicolons between them" : "";
      throw new Error(`line ${lineNumber}: expected ${names.length} values as in the header, found ${parts.length}${advice}`);
    }
    const time = instant(parts[place], isComma);
    if (time !== time) {
      if (count === 0 && Object.keys(units).length === 0 && (/^[[(]?s[\])]?$/.test(parts[place].trim()) || parts.every((part) => Number.isNaN(number(part, isComma))))) {
        names.forEach((name, k) => { units[name] = parts[k].trim(); });
        return;
      }
      throw new Error(`line ${lineNumber}: expected a time in the column "${names[place]}", found "${parts[place]}"`);
    }
    if (time < before) throw new Error(`line ${lineNumber}: the time ${time} is before ${before}, the time of the row above; sort the rows by their time`);
    before = time;
    if (count === columns[0].length) {
      columns = columns.map((column) => {
        const longer = new Float64Array(2 * column.length);
        longer.set(column);
        return longer;
      });
    }
    for (let k = 0; k < parts.length; k += 1) columns[k][count] = k === place ? time : number(parts[k], isComma);
    count += 1;
  };
  let rest = "";
  let reported = 0;
  for (;;) {
    const part = await source.read().catch((error) => {
      throw new Error(`it is damaged: ${error.message}. Copy or write it again.`);
    });
    const lines = (rest + decoder.decode(part.value, { stream: !part.done })).split(/\r\n|\n|\r(?!$)/);
    rest = part.done ? "" : lines.pop();
    for (const line of lines) take(line);
    if (part.done) break;
    if (done / file.size > reported + 0.02) {
      reported = done / file.size;
      postMessage({ kind: "progress", part: reported });
    }
  }
  if (!names) throw new Error("it is empty; expected a header and rows of numbers");
  if (count === 0) throw new Error("expected rows of numbers below the header, found none");
  columns = columns.map((column) => column.subarray(0, count));
  const numeric = names.filter((_, k) => k !== place && columns[k].some((value) => value === value));
  table = { read: async (name) => columns[names.indexOf(name)].slice() };
  const others = names.filter((name, k) => k !== place && !numeric.includes(name));
  return { time: names[place], names: numeric, units, count, remark: remarkOn(others) };
}

// A value of a Parquet file as a number.
function plain(value) {
  if (value instanceof Date) return value.getTime() / 1000;
  return typeof value === "number" || typeof value === "bigint" || typeof value === "boolean" ? Number(value) : NaN;
}

async function openParquet(file) {
  const { parquetMetadataAsync, parquetRead, parquetSchema } = await import("./hyparquet.min.js");
  const damaged = (error) => {
    throw new Error(`it is damaged or not whole: ${error.message}. Copy or write it again.`);
  };
  const source = { byteLength: file.size, slice: (from, until) => file.slice(from, until).arrayBuffer() };
  const metadata = await parquetMetadataAsync(source).catch(damaged);
  const codecs = new Set(metadata.row_groups.flatMap(({ columns }) => columns.map((column) => column.meta_data.codec)));
  const isPlain = [...codecs].every((codec) => codec === "UNCOMPRESSED" || codec === "SNAPPY");
  const compressors = isPlain ? undefined : (await import("./codecs.min.js")).compressors;
  const all = parquetSchema(metadata).children;
  const leaves = all.filter(({ children, element }) => children.length === 0 && element.type !== "BYTE_ARRAY" && element.type !== "FIXED_LEN_BYTE_ARRAY");
  const names = leaves.map(({ element }) => element.name);
  const count = Number(metadata.num_rows);
  if (names.length < 2) throw new Error("expected a column of times and variables that are numbers");
  if (count === 0) throw new Error("expected rows, found none");
  const read = async (name) => {
    const values = new Float64Array(count).fill(NaN);
    const onChunk = ({ columnData, rowStart }) => {
      for (let k = 0; k < columnData.length; k += 1) values[rowStart + k] = plain(columnData[k]);
    };
    await parquetRead({ file: source, metadata, columns: [name], compressors, onChunk }).catch(damaged);
    return values;
  };
  const time = names.find((name) => /^(time|t)$/i.test(name)) ?? names[0];
  const times = await read(time);
  for (let k = 0; k < count; k += 1) {
    if (times[k] !== times[k]) throw new Error(`row ${k + 1}: expected a time in the column "${time}", found none`);
    if (times[k] < times[k - 1]) throw new Error(`row ${k + 1}: the time ${times[k]} is before ${times[k - 1]}, the time of the row above; sort the rows by their time`);
  }
  table = { read };
  const others = all.filter((column) => !leaves.includes(column)).map(({ element }) => element.name);
  return { time, names: names.filter((name) => name !== time), units: {}, count, remark: remarkOn(others) };
}

const actions = {
  async open({ file }) {
    const begin = new Uint8Array(await file.slice(0, 4096).arrayBuffer());
    const isParquet = /\.(parquet|pq)$/i.test(file.name) || String.fromCharCode(...begin.slice(0, 4)) === "PAR1";
    postMessage({ kind: "opened", ...(await (isParquet ? openParquet(file) : openCsv(file, begin))) });
  },
  async read({ name }) {
    const values = await table.read(name);
    postMessage({ kind: "values", values }, [values.buffer]);
  },
};

onmessage = async ({ data }) => {
  try {
    await actions[data.kind](data);
  } catch (error) {
    postMessage({ kind: "refused", text: error.message });
  }
};
