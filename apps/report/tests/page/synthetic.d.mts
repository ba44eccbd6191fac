// SPDX-License-Identifier: BSD-3-Clause
import type { PackedArray } from "../../src/data/contract";
export function pack(numbers: ArrayBufferView): PackedArray;
