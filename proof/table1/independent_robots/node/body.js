// A differential-drive robot as arithmetic: its state is computed when somebody asks, from the time that has passed.
"use strict";
const { randomUUID } = require("node:crypto");

const TICK_S = 0.01;
const LIMITS = { linear: 0.5, angular: 1.5, cruise: 0.4, turn: 1.4, acceleration: 2, spin: 8, holdS: 1 };
const REACH_M = 50;
const ARRIVED = 0.03;

const bounded = (value, size) => Math.max(-size, Math.min(size, value));
const wrapped = (angle) => Math.atan2(Math.sin(angle), Math.cos(angle));
const yawOf = (q) => Math.atan2(2 * (q.w * q.z + q.x * q.y), 1 - 2 * (q.y * q.y + q.z * q.z));
const vector = (x, y, z) => ({ x, y, z });
const pose = (x, y, yaw) => ({
  position: vector(x, y, 0),
  orientation: { x: 0, y: 0, z: Math.sin(yaw / 2), w: Math.cos(yaw / 2) },
});
const stamp = (ms) => ({ sec: Math.floor(ms / 1000), nanosec: Math.floor((ms % 1000) * 1e6) });
const diagonal = (variance) => Array.from({ length: 36 }, (_, i) => (i % 7 === 0 ? variance : 0));

class Body {
  constructor() {
    Object.assign(this, { x: 0, y: 0, yaw: 0, v: 0, w: 0, command: [0, 0], until: 0, goal: null });
    this.tick = Math.floor(Date.now() / 1000 / TICK_S);
  }

  twist() {
    this.advance();
    return { linear: vector(this.v, 0, 0), angular: vector(0, 0, this.w) };
  }

  odometry() {
    const twist = this.twist();
    return {
      header: { stamp: stamp(Math.round(this.tick * TICK_S * 1000)), frame_id: "odom" },
      child_frame_id: "base_link",
      pose: { pose: pose(this.x, this.y, this.yaw), covariance: diagonal(0.001) },
      twist: { twist, covariance: diagonal(0.0001) },
    };
  }

  // Without w, the turning rate that was commanded last is kept. Returns the command.
  drive(v, w) {
    this.advance();
    this.command = [v, w ?? (this.until > this.tick ? this.command[1] : 0)];
    this.until = this.tick + Math.round(LIMITS.holdS / TICK_S);
    return { linear: vector(v, 0, 0), angular: vector(0, 0, this.command[1]) };
  }

  current() {
    this.advance();
    return this.goal;
  }

  send(id, frame, target) {
    this.goal = { id: id ?? randomUUID(), frame, target, since: Date.now() };
    this.until = 0;
    return this.goal;
  }

  knows(x, y) {
    return Math.hypot(x, y) <= REACH_M;
  }

  // Poses of a straight line, 0.1 m apart at most.
  path(start, x, y, yaw) {
    this.advance();
    const [fromX, fromY, fromYaw] = start ?? [this.x, this.y, this.yaw];
    const steps = Math.max(1, Math.ceil(Math.hypot(x - fromX, y - fromY) / 0.1));
    const heading = Math.atan2(y - fromY, x - fromX);
    const between = Array.from({ length: steps - 1 }, (_, i) => (i + 1) / steps);
    return [
      pose(fromX, fromY, fromYaw),
      ...between.map((part) => pose(fromX + part * (x - fromX), fromY + part * (y - fromY), heading)),
      pose(x, y, yaw),
    ];
  }

  advance() {
    const now = Math.floor(Date.now() / 1000 / TICK_S);
    if (!this.v && !this.w && !this.goal && this.until <= this.tick) this.tick = now;
    for (; this.tick < now; this.tick++) {
      const [v, w] = this.aim();
      this.v += bounded(v - this.v, LIMITS.acceleration * TICK_S);
      this.w += bounded(w - this.w, LIMITS.spin * TICK_S);
      const middle = this.yaw + (this.w * TICK_S) / 2;
      this.x += this.v * Math.cos(middle) * TICK_S;
      this.y += this.v * Math.sin(middle) * TICK_S;
      this.yaw = wrapped(this.yaw + this.w * TICK_S);
    }
  }

  aim() {
    if (!this.goal) return this.until > this.tick ? this.command : [0, 0];
    const { position, orientation } = this.goal.target;
    const distance = Math.hypot(position.x - this.x, position.y - this.y);
    if (distance > ARRIVED) {
      const off = wrapped(Math.atan2(position.y - this.y, position.x - this.x) - this.yaw);
      const turn = bounded(3 * off, LIMITS.turn);
      return Math.abs(off) > 0.2 ? [0, turn] : [Math.min(LIMITS.cruise, 0.03 + 1.5 * distance), turn];
    }
    const off = wrapped(yawOf(orientation) - this.yaw);
    if (Math.abs(off) > ARRIVED) return [0, bounded(3 * off, LIMITS.turn)];
    this.goal = null;
    return [0, 0];
  }
}

module.exports = { Body, LIMITS, stamp };
