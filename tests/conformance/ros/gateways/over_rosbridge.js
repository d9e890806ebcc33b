// A gateway on node:http that reaches ROS through a server of the rosbridge protocol:
// `node --experimental-websocket over_rosbridge.js PORT BRIDGE_PORT SURFACE FAULT`, SURFACE a file of surface.py.
"use strict";
const { createServer } = require("http");
const { randomUUID } = require("crypto");
const { readFileSync } = require("fs");

const [port, bridgePort, file, given = ""] = process.argv.slice(2);
const faults = new Set(given.split(","));
const { reads, publishes, services, action, deadline_s: deadlineS, openapi } = JSON.parse(readFileSync(file, "utf8"));
const deadline = deadlineS * 1000;
const ends = (all) => new Map(all.map((end) => [end.name, end]));
const [readsBy, publishesBy, servicesBy] = [ends(reads), ends(publishes), ends(services)];

// JSON whose integers keep all digits, and whose zeros their sign.
const parse = (text) => {
  const marked = text.replace(/"(?:[^"\\]|\\.)*"|-?\d+(?:\.\d+)?(?:[eE][+-]?\d+)?/g, (token) => (/^-?\d{16,}$/.test(token) ? `{"\\u0000":"${token}"}` : token));
  return JSON.parse(marked, (_, value) => (value && typeof value === "object" && typeof value["\0"] === "string" ? BigInt(value["\0"]) : value));
};
const write = (value) => {
  if (typeof value === "bigint") return String(value);
  if (Object.is(value, -0)) return "-0.0";
  if (Array.isArray(value)) return `[${value.map(write).join(",")}]`;
  if (value && typeof value === "object") return `{${Object.entries(value).filter(([, item]) => item !== undefined).map(([name, item]) => `${JSON.stringify(name)}:${write(item)}`).join(",")}}`;
  return JSON.stringify(value);
};

class Problem extends Error {
  constructor(status, detail) {
    super(detail);
    this.status = status;
  }
}

// The bridge: each request has an id, and waits for the response with it.
const last = new Map();
const waiting = new Map();
const goals = new Map();
let socket;
const connect = () => {
  socket = new WebSocket(`ws://127.0.0.1:${bridgePort}`);
  socket.onopen = () => reads.forEach((end) => socket.send(write({ op: "subscribe", topic: end.ros, type: end.type })));
  // A connection that fails may end with either event alone.
  let again;
  socket.onclose = socket.onerror = () => (again = again || setTimeout(connect, 200));
  socket.onmessage = ({ data }) => came(parse(data));
};
const came = (said) => {
  const goal = goals.get(said.id);
  if (said.op === "publish") last.set(said.topic, { message: said.msg, at: performance.now() });
  else if (said.op === "action_feedback" && goal) goal.feedback = said.values;
  else if (said.op === "action_result" && goal) ended(goal, said);
  if (said.id && waiting.has(said.id)) waiting.get(said.id)(said);
};
const ended = (goal, said) => {
  const missing = /does not exist/.test(said.values);
  goal.status = { 4: "SUCCEEDED", 5: "CANCELED", 6: "ABORTED" }[said.status] || (missing ? "MISSING" : "REJECTED");
  if (said.status === 0 && /^refused/.test(said.values)) goal.problem = said.values;
  if (said.result) goal.result = said.values;
};
const ask = (said, within = deadline) =>
  new Promise((resolve, reject) => {
    if (socket.readyState !== WebSocket.OPEN) return reject(new Problem(503, "the bridge is away"));
    const id = said.id || randomUUID();
    const timer = setTimeout(() => (waiting.delete(id), reject(new Problem(504, "no response in time"))), within);
    waiting.set(id, (response) => (clearTimeout(timer), waiting.delete(id), resolve(response)));
    socket.send(write({ ...said, id }));
  });

const member = (body, name) => {
  if (!body || typeof body !== "object" || Array.isArray(body) || Object.keys(body).join() !== name) throw new Problem(422, `expected one member, ${name}`);
  return body[name];
};
const newest = (end) => {
  const found = last.get(end.ros);
  const late = found && end.max_age_s && performance.now() - found.at > end.max_age_s * 1000;
  if (!found || (late && !faults.has("stale"))) throw new Problem(503, "no fresh message");
  return found.message;
};
const publish = async (end, message) => {
  const said = await ask({ op: "publish", topic: end.ros, msg: message });
  if (said.op !== "status" || said.level === "error") throw new Problem(422, said.msg);
  return { ok: true };
};
const call = async (end, request) => {
  const said = await ask({ op: "call_service", service: end.ros, type: end.type, args: request }, deadline + 500);
  if (said.result === true) return { values: said.values };
  const status = /does not exist/.test(said.values) ? 503 : /does not answer/.test(said.values) ? 504 : 422;
  throw new Problem(status, String(said.values));
};
const begin = async (args) => {
  const goal = { id: randomUUID(), status: "RUNNING" };
  goals.set(goal.id, goal);
  // The protocol has no message for an accepted goal: what does not come soon is running.
  await ask({ op: "send_action_goal", id: goal.id, action: action.ros, action_type: action.type, args, feedback: true }, 300).catch((problem) => {
    if (problem.status === 503) throw problem;
  });
  if (goal.problem) throw new Problem(422, goal.problem);
  if (goal.status === "MISSING") throw new Problem(503, "there is no server");
  return goal;
};
const goalOf = (id) => {
  const goal = goals.get(id);
  if (!goal) throw new Problem(404, "no such goal");
  return goal;
};
const cancel = async (goal) => {
  if (goal.status !== "RUNNING") throw new Problem(409, "it has ended");
  if (socket.readyState !== WebSocket.OPEN) throw new Problem(503, "the bridge is away");
  socket.send(write({ op: "cancel_action_goal", id: goal.id, action: action.ros }));
  return { ok: true };
};
const shown = ({ id, status, feedback = null, result = null }) => ({ id, status: status === "MISSING" ? "REJECTED" : status, feedback, result });

const respond = async (method, path, body) => {
  const [, root, name, id] = path.split("/");
  if (path === "/openapi.json" && method === "GET") return [200, openapi];
  if (root !== "robot") throw new Problem(404, "not found");
  if (name === undefined && method === "GET") {
    const { values } = await ask({ op: "call_service", service: "/rosapi/topics" });
    return [200, { topics: values.topics.map((topic, place) => ({ name: topic, type: values.types[place] })) }];
  }
  if (name === action.name && id) {
    if (method === "GET") return [200, shown(goalOf(id))];
    if (method === "DELETE") return [200, await cancel(goalOf(id))];
  } else if (name === action.name && method === "POST") return [202, shown(await begin(member(body(), "args")))];
  else if (readsBy.has(name) && method === "GET") return [200, { topic: readsBy.get(name).ros, message: newest(readsBy.get(name)) }];
  else if (publishesBy.has(name) && method === "POST") return [200, await publish(publishesBy.get(name), member(body(), "message"))];
  else if (servicesBy.has(name) && method === "POST") return [200, await call(servicesBy.get(name), member(body(), "args"))];
  const known = name === action.name || readsBy.has(name) || publishesBy.has(name) || servicesBy.has(name);
  throw new Problem(known ? 405 : 404, "not here");
};
const allowed = (path) => (path.split("/").length > 3 ? "GET, DELETE" : readsBy.has(path.split("/")[2]) ? "GET" : "POST");
let before = Promise.resolve();
createServer(async (request, response) => {
  const chunks = [];
  for await (const chunk of request) chunks.push(chunk);
  const path = request.url.split("?")[0];
  const body = () => {
    if ((request.headers["content-type"] || "").split(";")[0].trim().toLowerCase() !== "application/json") throw new Problem(415, "send application/json");
    try {
      return parse(new TextDecoder("utf-8", { fatal: true }).decode(Buffer.concat(chunks)));
    } catch (error) {
      throw new Problem(400, error.message);
    }
  };
  let status, value;
  try {
    if (faults.has("calls hold up reads")) await before;
    const responding = respond(request.method, path, body);
    before = responding.catch(() => {});
    [status, value] = await responding;
  } catch (error) {
    [status, value] = [error.status || 500, { detail: error.message }];
  }
  const text = write(value);
  const headers = { "Content-Type": "application/json", "Content-Length": Buffer.byteLength(text), ...(status === 405 ? { Allow: allowed(path) } : {}) };
  response.writeHead(status, headers).end(request.method === "HEAD" ? undefined : text);
}).listen(Number(port), "127.0.0.1", connect);
