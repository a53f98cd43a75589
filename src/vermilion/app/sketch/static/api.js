// Requests to the server; every failure is an error whose message is a sentence.
import { unpack } from "./packet.js";

export class RequestError extends Error {
  constructor(sentence, status) {
    super(sentence);
    this.status = status;
  }
}

async function ask(path, options = {}) {
  let answer;
  try {
    answer = await fetch(path, { credentials: "same-origin", ...options });
  } catch {
    throw new RequestError("The server does not answer: is `make sketch` still running?", 0);
  }
  if (answer.ok) return answer;
  let sentence = `The server answered ${answer.status}.`;
  try {
    const text = await answer.text();
    sentence = text.startsWith("{") ? JSON.parse(text).error : text || sentence;
  } catch { /* keep the plain sentence */ }
  throw new RequestError(sentence, answer.status);
}

export const getJson = async (path) => (await ask(path)).json();
export const getPacket = async (path) => unpack(await (await ask(path)).arrayBuffer());
export const getImage = async (path) => createImageBitmap(await (await ask(path)).blob());
export async function send(method, path, content = {}) {
  const options = { method, body: JSON.stringify(content), headers: { "Content-Type": "application/json" } };
  return (await ask(path, options)).json();
}
