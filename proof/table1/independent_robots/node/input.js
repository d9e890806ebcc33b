// Input against a shape; what does not fit is refused by name and value.
"use strict";

class Refused extends Error {
  constructor(status, detail) {
    super(detail);
    this.status = status;
  }
}

const VECTOR3 = { x: "number", y: "number", z: "number" };
const TWIST = { linear: VECTOR3, angular: VECTOR3 };
const TIME = { sec: "number", nanosec: "number" };
const HEADER = { "stamp?": TIME, frame_id: "string" };
const POSE = { position: VECTOR3, orientation: { ...VECTOR3, w: "number" } };
const GOAL = {
  "header?": HEADER,
  "goal_id?": { "stamp?": TIME, id: "string" },
  goal: { target_pose: { header: HEADER, pose: POSE } },
};
const NUMBER = /^[+-]?(\d+(\.\d+)?|\.\d+)([eE][+-]?\d+)?$/;

function told(value) {
  try {
    return JSON.stringify(value).slice(0, 200);
  } catch (error) {
    if (error instanceof RangeError) return "a value that is too deep to be shown";
    throw error;
  }
}

function fit(value, shape, path = "") {
  if (typeof shape === "string") {
    if (typeof value === shape && (shape !== "number" || Number.isFinite(value))) return value;
    throw new Refused(422, `${path}: ${told(value)} is no ${shape}`);
  }
  if (value === null || typeof value !== "object" || Array.isArray(value)) {
    throw new Refused(422, `${path || "body"}: ${told(value)} is no object`);
  }
  const joined = (name) => (path ? `${path}.${name}` : name);
  for (const name of Object.keys(value)) {
    if (!Object.hasOwn(shape, name) && !Object.hasOwn(shape, `${name}?`)) throw new Refused(422, `${joined(name)}: unknown field`);
  }
  for (const [key, part] of Object.entries(shape)) {
    const name = key.replace(/\?$/, "");
    if (Object.hasOwn(value, name)) fit(value[name], part, joined(name));
    else if (name === key) throw new Refused(422, `${joined(name)}: missing`);
  }
  return value;
}

function number(text, name) {
  if (!NUMBER.test(text) || !Number.isFinite(Number(text))) {
    throw new Refused(422, `${name}: ${JSON.stringify(text.slice(0, 200))} is no finite number`);
  }
  return Number(text);
}

module.exports = { GOAL, Refused, TWIST, VECTOR3, fit, number };
