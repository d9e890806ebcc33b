// The right API of apps.py on Node's own server, Express or Fastify: server.js SERVER PORT, MODULES in NODE_PATH.
const spec = require('./spec.json')
const [server, port] = process.argv.slice(2)
const content = { '/state': { x: 1.5 }, '/openapi.json': spec }
const fits = (body) => body !== null && typeof body === 'object' && !Array.isArray(body) &&
  Object.keys(body).length === 1 && typeof body.x === 'number' && Math.abs(body.x) <= 10
if (server === 'express') {
  const express = require('express')
  const app = express()
  for (const [path, value] of Object.entries(content)) app.get(path, (_, response) => response.json(value))
  const json = (request, response, next) => request.is('json') ? next() : response.status(415).end()
  app.post('/distance', json, express.json({ strict: false }), (request, response) => fits(request.body)
    ? response.json({ x: Math.abs(request.body.x) })
    : response.status(400).end())
  app.use((error, request, response, next) => response.status(error.status ?? 500).end())
  app.listen(+port, '127.0.0.1')
} else if (server === 'fastify') {
  const app = require('fastify')()
  app.removeContentTypeParser('text/plain')
  for (const [path, value] of Object.entries(content)) app.get(path, async () => value)
  app.post('/distance', async (request, reply) => fits(request.body)
    ? { x: Math.abs(request.body.x) }
    : reply.code(400).send())
  app.listen({ port: +port, host: '127.0.0.1' })
} else {
  const send = (request, response, status, value, fields = {}) => {
    const body = value === undefined ? '' : JSON.stringify(value)
    const type = body ? { 'Content-Type': 'application/json' } : {}
    response.writeHead(status, { ...type, 'Content-Length': Buffer.byteLength(body), ...fields })
    response.end(request.method === 'HEAD' ? undefined : body)
  }
  require('http').createServer((request, response) => {
    const path = request.url.split('?')[0]
    const methods = path === '/distance' ? ['POST'] : content[path] ? ['GET', 'HEAD'] : []
    if (!methods.length) return send(request, response, 404)
    if (!methods.includes(request.method)) return send(request, response, 405, undefined, { Allow: methods.join(', ') })
    if (request.method !== 'POST') return send(request, response, 200, content[path])
    const chunks = []
    request.on('data', (chunk) => chunks.push(chunk)).on('end', () => {
      const type = (request.headers['content-type'] ?? '').split(';')[0].trim().toLowerCase()
      if (type !== 'application/json') return send(request, response, 415)
      try {
        const body = JSON.parse(new TextDecoder('utf-8', { fatal: true }).decode(Buffer.concat(chunks)))
        if (fits(body)) return send(request, response, 200, { x: Math.abs(body.x) })
      } catch {}
      send(request, response, 400)
    })
  }).listen(+port, '127.0.0.1')
}
