// A feeder on Express that keeps its description: `node feeder.js PORT`, with express in NODE_PATH.
"use strict";
const express = require("express");
const { randomUUID } = require("crypto");

const text = (more) => ({ type: "string", ...more });
const object = (required, properties) => ({ type: "object", required, properties });
const error = { description: "an error", content: { "application/json": { schema: { $ref: "#/components/schemas/Error" } } } };
const answer = (name, many) => ({
  description: "done",
  content: { "application/json": { schema: many ? { type: "array", items: { $ref: `#/components/schemas/${name}` } } : { $ref: `#/components/schemas/${name}` } } },
});
const id = (name, schema) => ({ name, in: "path", required: true, schema });
const query = (name, schema) => ({ name, in: "query", schema });
const body = (name) => ({ required: true, content: { "application/json": { schema: { $ref: `#/components/schemas/${name}` } } } });
const jobMembers = {
  part: text({ minLength: 1, maxLength: 30 }),
  count: { type: "integer", minimum: 1, maximum: 500 },
  priority: text({ enum: ["low", "normal", "high"] }),
};
const lane = id("lane", { type: "integer", minimum: 1, maximum: 8 });
const job = id("job", text({ format: "uuid" }));
const description = {
  openapi: "3.0.3",
  info: { title: "Feeder", version: "2.1" },
  paths: {
    "/status": { get: { operationId: "status", responses: { 200: answer("Status") } } },
    "/lanes": {
      get: {
        operationId: "lanes",
        parameters: [query("state", text({ enum: ["empty", "loaded", "jammed"] })), query("limit", { type: "integer", minimum: 1, maximum: 20, default: 8 }), query("reverse", { type: "boolean" })],
        responses: { 200: answer("Lane", true), 400: error },
      },
    },
    "/lanes/{lane}": { get: { operationId: "lane", parameters: [lane], responses: { 200: answer("Lane"), 400: error } } },
    "/lanes/{lane}/load": { post: { operationId: "load", parameters: [lane], requestBody: body("Load"), responses: { 200: answer("Lane"), 400: error, 415: error } } },
    "/jobs": {
      get: { operationId: "jobs", parameters: [query("priority", jobMembers.priority)], responses: { 200: answer("Job", true), 400: error } },
      post: { operationId: "addJob", requestBody: body("NewJob"), responses: { 201: answer("Job"), 400: error, 415: error } },
    },
    "/jobs/{job}": {
      get: { operationId: "job", parameters: [job], responses: { 200: answer("Job"), 400: error, 404: error } },
      delete: { operationId: "dropJob", parameters: [job], responses: { 204: { description: "gone" }, 400: error, 404: error } },
    },
  },
  components: {
    schemas: {
      Error: object(["error"], { error: text() }),
      Status: object(["state", "uptime", "since"], { state: text({ enum: ["ready", "busy"] }), uptime: { type: "number", minimum: 0 }, since: text({ format: "date-time" }), operator: text({ nullable: true }) }),
      Lane: object(["lane", "state", "parts"], { lane: { type: "integer", minimum: 1, maximum: 8 }, state: text({ enum: ["empty", "loaded", "jammed"] }), parts: { type: "integer", minimum: 0 } }),
      Load: { ...object(["parts"], { parts: { type: "integer", minimum: 0, maximum: 100 }, sorted: { type: "boolean" } }), additionalProperties: false },
      NewJob: object(["part", "count"], jobMembers),
      Job: object(["job", "part", "count", "priority"], { job: text({ format: "uuid" }), ...jobMembers }),
    },
  },
};

// What is wrong with a value by a schema, or nothing.
function wrong(schema, value) {
  if (schema.$ref) return wrong(description.components.schemas[schema.$ref.split("/").pop()], value);
  if (schema.type === "object") {
    if (value === null || typeof value !== "object" || Array.isArray(value)) return "no object";
    const missing = schema.required.find((name) => !(name in value));
    if (missing) return `${missing} is missing`;
    const names = Object.keys(value);
    if (schema.additionalProperties === false && names.some((name) => !Object.hasOwn(schema.properties, name))) return "an unknown member";
    return names.filter((name) => Object.hasOwn(schema.properties, name)).map((name) => wrong(schema.properties[name], value[name])).find(Boolean);
  }
  if (schema.type === "integer" && !Number.isInteger(value)) return "no integer";
  if (schema.type === "boolean" && typeof value !== "boolean") return "no boolean";
  if (schema.type === "string" && typeof value !== "string") return "no text";
  if (schema.minimum > value || schema.maximum < value) return "out of bounds";
  if (schema.enum && !schema.enum.includes(value)) return "an unknown value";
  if (schema.minLength && [...value].length < schema.minLength) return "too short";
  if (schema.maxLength && [...value].length > schema.maxLength) return "too long";
  if (schema.format === "uuid" && !/^[0-9a-f]{8}(-[0-9a-f]{4}){3}-[0-9a-f]{12}$/i.test(value)) return "no UUID";
  return undefined;
}

// The value that the text of a parameter stands for.
function read(schema, value) {
  if (schema.type === "integer") return /^-?\d+$/.test(value) ? Number(value) : value;
  return schema.type === "boolean" && ["true", "false"].includes(value) ? value === "true" : value;
}

const lanes = [1, 2, 3, 4, 5, 6, 7, 8].map((number) => ({ lane: number, state: "empty", parts: 0 }));
const jobs = new Map();
const add = (made) => { const known = { job: randomUUID(), priority: "normal", ...made }; jobs.set(known.job, known); return known; };
add({ part: "bolt", count: 5 });
const since = new Date().toISOString();
const app = express();
app.disable("x-powered-by");
app.use((request, response, next) => {
  // Node takes two Host fields, which RFC 9112 3.2 forbids.
  const hosts = request.rawHeaders.filter((name, at) => at % 2 === 0 && name.toLowerCase() === "host");
  return hosts.length > 1 ? response.status(400).json({ error: "one Host is needed" }) : next();
});
app.use(express.json({ strict: false }));

const handlers = {
  status: (_, response) => response.json({ state: "ready", uptime: process.uptime(), since, operator: null }),
  lanes: ({ given }, response) => {
    const found = lanes.filter((one) => !given.state || one.state === given.state);
    response.json((given.reverse ? found.reverse() : found).slice(0, given.limit ?? 8));
  },
  lane: ({ given }, response) => response.json(lanes[given.lane - 1]),
  load: ({ given, body: load }, response) => response.json(Object.assign(lanes[given.lane - 1], { parts: load.parts, state: load.parts ? "loaded" : "empty" })),
  jobs: ({ given }, response) => response.json([...jobs.values()].filter((one) => !given.priority || one.priority === given.priority)),
  addJob: ({ body: { part, count, priority = "normal" } }, response) => {
    const made = add({ part, count, priority });
    if (jobs.size > 50) jobs.delete(jobs.keys().next().value);
    response.status(201).location(`/jobs/${made.job}`).json(made);
  },
  job: ({ given }, response) => (jobs.has(given.job) ? response.json(jobs.get(given.job)) : response.status(404).json({ error: "no such job" })),
  dropJob: ({ given }, response) => {
    if (!jobs.delete(given.job)) return response.status(404).json({ error: "no such job" });
    if (!jobs.size) add({ part: "bolt", count: 5 });
    return response.status(204).end();
  },
};

app.get("/openapi.json", (_, response) => response.json(description));
for (const [path, item] of Object.entries(description.paths)) {
  const route = app.route(path.replace(/\{(\w+)\}/g, ":$1"));
  for (const [method, operation] of Object.entries(item)) {
    route[method]((request, response, next) => {
      request.given = {};
      for (const one of operation.parameters ?? []) {
        const found = one.in === "path" ? request.params[one.name] : request.query[one.name];
        if (found === undefined) continue;
        request.given[one.name] = read(one.schema, found);
        const problem = wrong(one.schema, request.given[one.name]);
        if (problem) return response.status(400).json({ error: `${one.name}: ${problem}` });
      }
      if (operation.requestBody) {
        if (!request.is("application/json")) return response.status(request.headers["content-type"] ? 415 : 400).json({ error: "a JSON body is needed" });
        const problem = wrong(operation.requestBody.content["application/json"].schema, request.body);
        if (problem) return response.status(400).json({ error: problem });
      }
      return handlers[operation.operationId](request, response, next);
    });
  }
  const allowed = Object.keys(item).map((name) => name.toUpperCase());
  const allow = [...allowed, ...(allowed.includes("GET") ? ["HEAD"] : []), "OPTIONS"].join(", ");
  route.options((_, response) => response.set("Allow", allow).status(204).end());
  route.all((_, response) => response.set("Allow", allow).status(405).json({ error: "no such method" }));
}
app.use((_, response) => response.status(404).json({ error: "nothing is here" }));
app.use((problem, _request, response, _next) => response.status(problem.status ?? 500).json({ error: problem.type ?? "a bad request" }));
const server = app.listen(Number(process.argv[2] ?? 8000), "127.0.0.1");
server.on("clientError", (problem, socket) => {
  if (!socket.writable) return socket.destroy();
  // Node refuses a method that it does not know before Express sees it, with 400 and without Date.
  const strange = problem.code === "HPE_INVALID_METHOD" && /^[A-Za-z-]+ \S+ HTTP\/1\.\d\r?\n/.test(problem.rawPacket?.toString("latin1"));
  const status = strange ? "501 Not Implemented" : problem.code === "HPE_HEADER_OVERFLOW" ? "431 Request Header Fields Too Large" : "400 Bad Request";
  return socket.end(`HTTP/1.1 ${status}\r\nDate: ${new Date().toUTCString()}\r\nConnection: close\r\nContent-Length: 0\r\n\r\n`);
});
