// The right API of apps.py on Node's own server, Express or Fastify: server.js SERVER PORT, MODULES in NODE_PATH.
const spec = require('./spec.json')
const [server, port] = process.argv.slice(2)
const content = { '/state': { x: 1.5 }, '/openapi.json': spec }
if (server === 'express') {
  const app = require('express')()
  for (const [path, value] of Object.entries(content)) app.get(path, (_, response) => response.json(value))
  app.listen(+port, '127.0.0.1')
} else if (server === 'fastify') {
  const app = require('fastify')()
  for (const [path, value] of Object.entries(content)) app.get(path, async () => value)
  app.listen({ port: +port, host: '127.0.0.1' })
} else {
  require('http').createServer((request, response) => {
    const value = content[request.url.split('?')[0]]
    if (!value) return response.writeHead(404).end()
    if (!['GET', 'HEAD'].includes(request.method)) return response.writeHead(405, { Allow: 'GET, HEAD' }).end()
    const body = JSON.stringify(value)
    response.writeHead(200, { 'Content-Type': 'application/json', 'Content-Length': Buffer.byteLength(body) })
    response.end(request.method === 'HEAD' ? undefined : body)
  }).listen(+port, '127.0.0.1')
}
