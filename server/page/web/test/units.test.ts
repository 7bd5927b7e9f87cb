import assert from "node:assert/strict";
import test from "node:test";
import { chanceText, durationText, nameForPeople, numberText, quantityText, unitForPeople } from "../src/units.ts";

test("a quantity is shown in the unit that fits its size", () => {
  assert.equal(quantityText(4.1e9, "young_modulus", "Pa"), "4.1\u202fGPa");
  assert.equal(quantityText(-250e3, "stress", "Pa"), "−250\u202fkPa");
  assert.equal(quantityText(0.0125, "axial_strain", "1"), "1.25\u202f%");
  assert.equal(quantityText(0.0125, "friction_coefficient", "1"), "0.0125");
  assert.equal(quantityText(Math.PI / 6, "rebound_angle", "rad"), "30\u202fdeg");
  assert.equal(quantityText(107, "work_of_adhesion", "J/m^2"), "107\u202fJ/m^2");
  assert.equal(quantityText(null, "axial_strain", "1"), "–");
});

test("sizes below the smallest step keep its label and the SI value", () => {
  assert.deepEqual(unitForPeople("stress", "Pa", 0), { factor: 1, label: "Pa" });
});

test("numbers have significant digits and no trailing zeros", () => {
  assert.equal(numberText(0), "0");
  assert.equal(numberText(1234.56), "1235");
  assert.equal(numberText(0.5), "0.5");
  assert.equal(numberText(100), "100");
  assert.equal(numberText(-0.012345, 3), "−0.0123");
  assert.equal(numberText(3.2e-5, 2), "3.2e−5");
  assert.equal(numberText(2e7), "2e7");
  assert.equal(numberText(NaN), "–");
  assert.equal(numberText(Infinity), "∞");
});

test("a chance is never said to be certain", () => {
  assert.equal(chanceText(0.9999), ">\u202f99\u202f%");
  assert.equal(chanceText(1e-9), "<\u202f1\u202f%");
  assert.equal(chanceText(0.635), "64\u202f%");
});

test("durations and names", () => {
  assert.equal(durationText(35.4), "35 s");
  assert.equal(durationText(4800), "1 h 20 min");
  assert.equal(durationText(null), "–");
  assert.equal(nameForPeople("rolling_resistance.friction"), "rolling resistance: friction");
});
