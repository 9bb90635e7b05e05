// Requests to the service, with its errors as words.

export async function ask(path, options = {}) {
  const answer = await fetch(path, options);
  if (answer.ok) return answer;
  const error = new Error(`${answer.status} ${answer.statusText}`);
  try {
    const told = (await answer.json()).error;
    error.message = told.text;
    error.code = told.code;
  } catch {
    // not an answer of the service itself
  }
  throw error;
}

export async function askJson(path, options = {}) {
  return (await ask(path, { headers: { Accept: "application/json" }, ...options })).json();
}
