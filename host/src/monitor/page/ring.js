// A table of fixed size in typed arrays: the newest rows of named columns over rising time. NaN is an unknown value.

export class Ring {
  // Holds at least the newest `capacity` rows.
  constructor(capacity, names) {
    this.capacity = capacity;
    this.names = names;
    this.length = 0;
    // Twice the size: when full, the newer half moves to the front, so that rows are always contiguous.
    this.t = new Float64Array(2 * capacity);
    this.columns = Object.fromEntries(names.map((name) => [name, new Float32Array(2 * capacity)]));
  }

  clear() {
    this.length = 0;
  }

  // Time of the newest row; −Infinity without rows.
  get last() {
    return this.length > 0 ? this.t[this.length - 1] : -Infinity;
  }

  get first() {
    return this.length > 0 ? this.t[0] : Infinity;
  }

  // Newest value of a column, or null.
  newest(name) {
    const value = this.length > 0 ? this.columns[name][this.length - 1] : NaN;
    return Number.isNaN(value) ? null : value;
  }

  // Adds a row and returns where it is; its values are NaN until set.
  push(t) {
    if (this.length === this.t.length) {
      const from = this.length - this.capacity;
      for (const column of [this.t, ...Object.values(this.columns)]) column.copyWithin(0, from);
      this.length = this.capacity;
    }
    const at = this.length;
    this.t[at] = t;
    for (const name of this.names) this.columns[name][at] = NaN;
    this.length += 1;
    return at;
  }

  // The first row at or after a time.
  search(t) {
    let low = 0;
    let high = this.length;
    while (low < high) {
      const middle = (low + high) >> 1;
      if (this.t[middle] < t) low = middle + 1;
      else high = middle;
    }
    return low;
  }

  // Forgets rows at and after a time.
  truncate(t) {
    this.length = this.search(t);
  }

  copy() {
    const other = new Ring(0, this.names);
    other.capacity = this.length;
    other.length = this.length;
    other.t = this.t.slice(0, this.length);
    other.columns = Object.fromEntries(this.names.map((name) => [name, this.columns[name].slice(0, this.length)]));
    return other;
  }
}

// Appends `{t_s, values}` of a message. Rows sent again replace the earlier ones. Returns whether the message part was valid.
export function append(ring, rows) {
  if (rows === null || typeof rows !== "object" || !Array.isArray(rows.t_s)) return false;
  const values = rows.values !== null && typeof rows.values === "object" ? rows.values : {};
  const times = rows.t_s;
  const columns = [];
  let isValid = true;
  for (const name of ring.names) {
    const source = Object.hasOwn(values, name) ? values[name] : undefined;
    if (source === undefined) continue;
    if (Array.isArray(source) && source.length === times.length) columns.push([source, ring.columns[name]]);
    else isValid = false;
  }
  const start = Math.max(0, times.length - ring.capacity);
  const begin = times.slice(start).find((t) => Number.isFinite(t));
  if (begin !== undefined && begin <= ring.last) ring.truncate(begin);
  for (let i = start; i < times.length; i += 1) {
    const t = times[i] ?? ring.last;
    if (!Number.isFinite(t) || t < ring.last) {
      isValid = false;
      continue;
    }
    const at = ring.push(t);
    for (const [source, target] of columns) {
      const value = source[i];
      if (typeof value === "number") target[at] = value;
    }
  }
  return isValid;
}
