// Walks with a live server in Node: node --experimental-websocket live.js http://localhost:8080

import { setTimeout as sleep } from "node:timers/promises";
import { golden } from "./golden.js";
import { walk } from "./walk.js";

const { walked, stats } = await walk(process.argv[2], golden("retarget.json").cases, () => sleep(16));
for (const line of walked) console.log(line);
console.log(JSON.stringify(stats));
