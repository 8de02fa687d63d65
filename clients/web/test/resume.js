// Reads a session's stream until its input ends, then prints every chunk that came: [agent, seq, gap]. For
// tests/clients/resume_stress.py.   node test/resume.js http://localhost:8080 SESSION

import { FLAG } from "../src/core/messages.js";
import { Session } from "../src/index.js";

const chunks = [];
let headers = 0;
const session = Session.join(process.argv[2], process.argv[3], {
  on: {
    header: () => { headers += 1; },
    chunk: ({ agent }, { seq, flags }) => chunks.push([agent.alias, seq, (flags & FLAG.GAP) !== 0]),
    failed: (reason) => { throw new Error(reason); },
    ended: (reason) => { throw new Error(reason); },
  },
});
process.stdin.resume().on("end", () => {
  session.close();
  process.stdout.write(JSON.stringify({ headers, chunks }), () => process.exit(0));
});
