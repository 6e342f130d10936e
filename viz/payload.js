"use strict";
// A block of data in the page: length of the header, header in JSON, then arrays and texts.

async function read_payload(id) {
  const packed = Uint8Array.from(atob(document.getElementById(id).textContent.trim()), (c) => c.charCodeAt(0));
  const stream = new Blob([packed]).stream().pipeThrough(new DecompressionStream("gzip"));
  const block = await new Response(stream).arrayBuffer();
  const head = new DataView(block).getUint32(0, true);
  const header = JSON.parse(new TextDecoder().decode(new Uint8Array(block, 4, head)));
  const kinds = { f4: Float32Array, u4: Uint32Array, i4: Int32Array, u1: Uint8Array };
  const blobs = header.blobs.map(([kind, offset, length]) => {
    const bytes = block.slice(4 + head + offset, 4 + head + offset + length);
    return kind === "text" ? new TextDecoder().decode(bytes) : new kinds[kind](bytes);
  });
  return resolve_references(header, blobs);
}

function resolve_references(value, blobs) {
  if (Array.isArray(value)) return value.map((item) => resolve_references(item, blobs));
  if (value === null || typeof value !== "object") return value;
  if ("$" in value) return blobs[value.$];
  return Object.fromEntries(Object.entries(value).map(([key, item]) => [key, resolve_references(item, blobs)]));
}

// Number of entries of an increasing array that are not above x, minus one, and at least 0.
function index_before(array, x) {
  let low = 0, high = array.length;
  while (high - low > 1) {
    const middle = (low + high) >> 1;
    if (array[middle] <= x) low = middle; else high = middle;
  }
  return low;
}

// The entries before and after a time, and how far it is from the one to the other, in [0, 1].
function neighbours(t, time) {
  const i = index_before(t, time), k = Math.min(i + 1, t.length - 1);
  return [i, k, k > i ? Math.min(Math.max((time - t[i]) / (t[k] - t[i]), 0), 1) : 0];
}

function make(tag, properties = {}, children = []) {
  const element = Object.assign(document.createElement(tag), properties);
  element.append(...children);
  return element;
}

// A colour of the style sheet by name.
function color_of(name) {
  if (!color_of.known.has(name)) {
    color_of.known.set(name, getComputedStyle(document.documentElement).getPropertyValue(`--${name}`).trim());
  }
  return color_of.known.get(name);
}
color_of.known = new Map();
