// A robot on Node's http, which answers by itself what it cannot parse: node robot.js PORT
"use strict";
const http = require("node:http");
const { Body, LIMITS, stamp } = require("./body.js");
const { GOAL, Refused, TWIST, VECTOR3, fit, number } = require("./input.js");

const LARGEST = 256 * 1024;
const DELIVERY = ["code", "depot_x", "depot_y", "dest_x", "dest_y", "source_x", "source_y"];
const DELIVERY_PATH = new RegExp(`^/robot/app/delivery/([^/]*)/${DELIVERY.slice(1).join("/([^/]*)/")}/([^/]*)$`);
const SENSORS = [{ name: "lidar", topic: "/scan", type: "sensor_msgs/msg/LaserScan" }];
const SERVICES = [{ name: "/get_plan", type: "nav_msgs/srv/GetPlan" }];
const FRAMES = ["map", "odom"];
const body = new Body();

const RESOURCES = {
  "/robot/pose/": { GET: () => [200, body.odometry()] },
  "/robot/velocity/": { GET: () => [200, body.twist()], PUT: putVelocity },
  "/robot/velocity/linear/": { GET: () => [200, body.twist().linear], PUT: putLinear },
  "/robot/sensors/": { GET: () => [200, SENSORS] },
  "/robot/navigation/services/": { GET: () => [200, SERVICES] },
  "/robot/navigation/action/goal/": { GET: getGoal, PUT: putGoal, DELETE: deleteGoal },
  "/robot/navigation/service/plan": { GET: getPlan },
};

async function putVelocity(request) {
  const { linear, angular } = fit(await json(request), TWIST);
  return drive({ "linear.y": linear.y, "linear.z": linear.z, "angular.x": angular.x, "angular.y": angular.y },
    ["linear.x", linear.x], ["angular.z", angular.z]);
}

async function putLinear(request) {
  const { x, y, z } = fit(await json(request), VECTOR3);
  const [status, twist] = drive({ y, z }, ["x", x], ["angular.z", null]);
  return [status, twist.linear];
}

function drive(still, [vName, v], [wName, w]) {
  for (const [name, value] of Object.entries(still)) {
    if (value !== 0) throw new Refused(422, `${name}: ${value} cannot be actuated`);
  }
  if (Math.abs(v) > LIMITS.linear) throw new Refused(422, `${vName}: ${v} is beyond ${LIMITS.linear} m/s`);
  if (Math.abs(w ?? 0) > LIMITS.angular) throw new Refused(422, `${wName}: ${w} is beyond ${LIMITS.angular} rad/s`);
  if (body.current()) throw new Refused(409, "a goal is active");
  return [200, body.drive(v, w)];
}

function shown(goal) {
  const header = { stamp: stamp(goal.since), frame_id: goal.frame };
  return {
    header,
    goal_id: { stamp: header.stamp, id: goal.id },
    goal: { target_pose: { header, pose: goal.target } },
    status: { code: 2, text: "" },
  };
}

function getGoal() {
  const goal = body.current();
  if (!goal) throw new Refused(404, "there is no goal");
  return [200, shown(goal)];
}

async function putGoal(request) {
  const { goal_id: given, goal } = fit(await json(request), GOAL);
  const { header, pose } = goal.target_pose;
  const at = "goal.target_pose";
  known(header.frame_id, `${at}.header.frame_id`);
  const length = Math.hypot(...Object.values(pose.orientation));
  if (!(Math.abs(length - 1) <= 1e-3)) throw new Refused(422, `${at}.pose.orientation: its length is ${length}`);
  reachable(pose.position.x, pose.position.y, `${at}.pose.position.x`);
  if (given && (given.id === "" || given.id.length > 255)) throw new Refused(422, `goal_id.id: ${given.id} is no id`);
  const now = body.current();
  if (now && now.id === given?.id) {
    if (JSON.stringify(now.target) !== JSON.stringify(pose)) throw new Refused(409, `goal_id.id: ${now.id} has another pose`);
    return [200, shown(now)];
  }
  return [201, shown(body.send(given?.id, header.frame_id, pose))];
}

function deleteGoal() {
  if (!body.current()) throw new Refused(404, "there is no goal");
  body.goal = null;
  return [204];
}

function getPlan(_request, query) {
  const value = (name, other) => (query.has(name) ? number(query.get(name), name) : other);
  for (const name of ["x", "y"]) if (!query.has(name)) throw new Refused(422, `${name}: missing in the query`);
  const [x, y, yaw] = [value("x"), value("y"), value("yaw", 0)];
  if (value("tolerance", 0.1) < 0) throw new Refused(422, `tolerance: ${query.get("tolerance")} is negative`);
  const frame = known(query.get("frame_id") ?? "map", "frame_id");
  const from = [value("start_x", body.x), value("start_y", body.y), value("start_yaw", 0)];
  reachable(x, y, "x");
  reachable(from[0], from[1], "start_x");
  const header = { stamp: stamp(Date.now()), frame_id: frame };
  const start = query.has("start_x") || query.has("start_y") ? from : null;
  return [200, { plan: { header, poses: body.path(start, x, y, yaw).map((pose) => ({ header, pose })) } }];
}

function known(frame, name) {
  if (!FRAMES.includes(frame)) throw new Refused(422, `${name}: ${JSON.stringify(frame)} is no frame of this robot`);
  return frame;
}

function reachable(x, y, name) {
  if (!body.knows(x, y)) throw new Refused(422, `${name}: ${x}, ${y} is beyond this robot's reach`);
}

function deliver(texts) {
  const values = texts.map((text, i) => number(decoded(text, DELIVERY[i]), DELIVERY[i]));
  if (values[0] !== 3 && values[0] !== 4) throw new Refused(422, `code: ${values[0]} is neither 3 nor 4`);
  return [204];
}

function decoded(text, name) {
  try {
    return decodeURIComponent(text);
  } catch {
    throw new Refused(400, `${name}: ${text} is not percent-encoded`);
  }
}

async function json(request) {
  const [type, ...parameters] = (request.headers["content-type"] ?? "").toLowerCase().split(";").map((part) => part.trim());
  if (type !== "application/json" || !parameters.every((part) => /^charset="?utf-?8"?$/.test(part))) {
    throw new Refused(415, `Content-Type: ${JSON.stringify(request.headers["content-type"] ?? null)} is not taken`);
  }
  const pieces = [];
  let size = 0;
  for await (const piece of request) {
    size += piece.length;
    if (size > LARGEST) throw new Refused(413, `more than ${LARGEST} octets`);
    pieces.push(piece);
  }
  try {
    return JSON.parse(new TextDecoder("utf-8", { fatal: true, ignoreBOM: true }).decode(Buffer.concat(pieces)));
  } catch (error) {
    throw new Refused(400, `no JSON: ${error.message}`);
  }
}

function acceptsJson(accept) {
  if (!accept?.trim()) return true;
  const quality = {};
  for (const member of accept.toLowerCase().split(",")) {
    const [range, ...parameters] = member.split(";").map((part) => part.trim());
    const weight = parameters.find((part) => part.startsWith("q="));
    quality[range] = weight ? Number(weight.slice(2)) || 0 : 1;
  }
  return (quality["application/json"] ?? quality["application/*"] ?? quality["*/*"] ?? 0) > 0;
}

function methodsOf(path) {
  const delivery = DELIVERY_PATH.exec(path);
  return delivery ? { PUT: () => deliver(delivery.slice(1)) } : RESOURCES[path];
}

async function answer(request, response) {
  // Node takes the first of several Host fields.
  if (request.headersDistinct.host.length > 1) throw new Refused(400, "Host is there more than once");
  const url = request.url === "*" ? null : new URL(request.url, "http://robot");
  const methods = url ? methodsOf(url.pathname) : {};
  if (!methods) throw new Refused(404, `there is no ${url.pathname.slice(0, 200)}`);
  const allowed = [...Object.keys(methods), ...("GET" in methods ? ["HEAD"] : []), "OPTIONS"].join(", ");
  if (request.method === "OPTIONS") return send(response, 204, undefined, { Allow: allowed });
  const method = request.method === "HEAD" ? "GET" : request.method;
  if (!Object.hasOwn(methods, method)) {
    return problem(response, new Refused(405, `there is no ${method} here`), { Allow: allowed });
  }
  if (!acceptsJson(request.headers.accept)) throw new Refused(406, `Accept: ${request.headers.accept} has no JSON`);
  const [status, value] = await methods[method](request, url.searchParams);
  return send(response, status, value);
}

function send(response, status, value, fields = {}, type = "application/json") {
  if (value === undefined) return response.writeHead(status, fields).end();
  const octets = Buffer.from(JSON.stringify(value));
  return response.writeHead(status, { "Content-Type": type, "Content-Length": octets.length, ...fields }).end(octets);
}

function problem(response, refused, fields = {}) {
  // What is left of a request that is too long is not read.
  const closing = refused.status === 413 ? { Connection: "close" } : {};
  const document = { status: refused.status, title: http.STATUS_CODES[refused.status], detail: refused.message };
  return send(response, refused.status, document, { ...fields, ...closing }, "application/problem+json");
}

const server = http.createServer((request, response) => {
  answer(request, response).catch((error) => {
    if (response.headersSent || request.destroyed && !request.complete) response.destroy();
    else if (error instanceof Refused) problem(response, error);
    else if (error.code === "ERR_INVALID_URL") problem(response, new Refused(400, "the target is no URL"));
    else {
      console.error(error);
      problem(response, new Refused(500, "this robot is at fault"));
    }
  });
});
server.listen(Number(process.argv[2] ?? 0), "127.0.0.1", () => {
  console.log(`ready rest=http://127.0.0.1:${server.address().port} soap=`);
});
process.on("SIGTERM", () => process.exit(0));
