// SPDX-License-Identifier: BSD-3-Clause
// A map that changes by boxes of cells, put together for any moment.
import { DataError } from "./decode";

export const kUnchanged = 254;
export const kUnknown = 255;

/** Where the cells of a map stand: cell (0, 0) has its lower left corner in `origin` [m]. */
export interface Lattice {
  resolution: number;
  origin: [number, number];
  yaw: number;
}

export interface RasterChange {
  x: number;
  y: number;
  width: number;
  height: number;
  /** Row by row from the lower left: per cent of being occupied, `kUnknown`, or `kUnchanged`. */
  cells: Uint8Array;
  /** A new map begins. */
  lattice: Lattice | null;
}

/** All cells that one map ever had, row by row from the lower left; (x, y) is where the first is on the lattice. */
export interface Cells {
  lattice: Lattice;
  x: number;
  y: number;
  width: number;
  height: number;
  values: Uint8Array;
}

const kCheckpointEvery = 32;
const kMostCells = 1e8;

export class Raster {
  private readonly changes: (RasterChange | null)[] = [];
  /** Which of `maps` there is at each moment. */
  private readonly which: number[] = [];
  private readonly maps: Cells[] = [];
  private readonly checkpoints = new Map<number, Uint8Array>();
  private now = -1;

  add(change: RasterChange | null): void {
    if (change?.lattice) this.maps.push({ lattice: change.lattice, x: Infinity, y: Infinity, width: 0, height: 0, values: new Uint8Array(0) });
    const map = this.maps.at(-1);
    if (!map && change) throw new DataError("cells of a map without a resolution");
    if (map && change) {
      const right = Math.max(map.width > 0 ? map.x + map.width : -Infinity, change.x + change.width);
      const high = Math.max(map.height > 0 ? map.y + map.height : -Infinity, change.y + change.height);
      map.x = Math.min(map.x, change.x);
      map.y = Math.min(map.y, change.y);
      map.width = right - map.x;
      map.height = high - map.y;
      if (map.width * map.height > kMostCells) throw new DataError("a map of more than 100 million cells");
    }
    this.changes.push(change);
    this.which.push(this.maps.length - 1);
  }

  /** After the last change; again after further ones. */
  finish(): void {
    const grown = this.maps.filter((map) => map.values.length !== map.width * map.height);
    if (grown.length === 0) return;
    for (const map of grown) map.values = new Uint8Array(map.width * map.height).fill(kUnknown);
    this.checkpoints.clear();
    this.now = -1;
  }

  at(k: number): Cells {
    if (k < this.now || this.now < 0) this.rewind(k);
    while (this.now < k) this.step();
    return this.maps[this.which[k]] ?? { lattice: { resolution: 1, origin: [0, 0], yaw: 0 }, x: 0, y: 0, width: 0, height: 0, values: new Uint8Array(0) };
  }

  private rewind(k: number): void {
    let from = Math.floor(k / kCheckpointEvery) * kCheckpointEvery;
    while (from > 0 && !this.checkpoints.has(from)) from -= kCheckpointEvery;
    const saved = this.checkpoints.get(from);
    this.now = saved ? from : -1;
    if (saved) this.maps[this.which[from]].values.set(saved);
  }

  private step(): void {
    const change = this.changes[++this.now];
    const map = this.maps[this.which[this.now]];
    if (!map) return;
    if (change?.lattice) map.values.fill(kUnknown);
    if (change) {
      for (let row = 0; row < change.height; ++row) {
        const to = (change.y - map.y + row) * map.width + change.x - map.x;
        for (let column = 0; column < change.width; ++column) {
          const value = change.cells[row * change.width + column];
          if (value !== kUnchanged) map.values[to + column] = value;
        }
      }
    }
    if (this.now % kCheckpointEvery === 0 && this.now > 0 && !this.checkpoints.has(this.now)) this.checkpoints.set(this.now, map.values.slice());
  }
}
