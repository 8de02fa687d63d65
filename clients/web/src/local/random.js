// Random numbers from a person's seed, equal to the server's (world/agents/style.py, mirror.py).

const MASK = (1n << 64n) - 1n;
const STEP = 0x9e3779b97f4a7c15n;
const REACTION = 1, OWN = 2, MANNER = 3; // independent draws of one seed
const STREAM = 0x5741594641524552n; // separates the noise of steps from other draws
const LATENT = 128, TRAITS = 8; // numbers of a latent, and of a manner

/** 64 bits of a seed, spread evenly (the finaliser of SplitMix64). @param {bigint} seed @param {number} draw */
function mixed(seed, draw) {
  let bits = (seed + BigInt(draw) * STEP) & MASK;
  bits = ((bits ^ (bits >> 30n)) * 0xbf58476d1ce4e5b9n) & MASK;
  bits = ((bits ^ (bits >> 27n)) * 0x94d049bb133111ebn) & MASK;
  return bits ^ (bits >> 31n);
}

/** The step, of `moments` in turn, with which a person sets off. @param {bigint} seed @param {number} moments */
export const reactionOf = (seed, moments) => Number(mixed(seed, REACTION) % BigInt(moments));

/** Whether the model moves the person's mirror image: half of all seeds. @param {bigint} seed */
export const isMirrored = (seed) => ((seed * STEP) & MASK) >> 63n === 1n;

/** A latent [128] ~ N(0, I), fixed for each person. @param {bigint} seed */
export const ownNoiseOf = (seed) => normals(philox(seed, BigInt(OWN), 0n), LATENT);

/** A manner [8] ~ N(0, I), fixed for each person. @param {bigint} seed */
export const mannerOf = (seed) => normals(philox(seed, BigInt(MANNER), 0n), TRAITS);

/** A latent [128] ~ N(0, I) for a chunk of a person. @param {bigint} seed @param {number} chunk */
export const noiseOf = (seed, chunk) => normals(philox(seed, STREAM, BigInt(chunk) << 64n), LATENT);

/** @param {() => number} next @param {number} length */
const normals = (next, length) => Float32Array.from({ length }, () => normal(next));

// Philox 4×64-10 (Salmon et al. 2011) as numpy has it: a source of 32 bits, the lower half of each word first.

/** @param {bigint} key0 @param {bigint} key1 @param {bigint} counter @returns {() => number} */
function philox(key0, key1, counter) {
  let at = 8;
  const halves = new Uint32Array(8);
  return () => {
    if (at === 8) {
      counter += 1n;
      block(counter, key0, key1).forEach((word, k) => {
        halves[2 * k] = Number(word & 0xffffffffn);
        halves[2 * k + 1] = Number(word >> 32n);
      });
      at = 0;
    }
    return halves[at++];
  };
}

/** @param {bigint} counter @param {bigint} key0 @param {bigint} key1 */
function block(counter, key0, key1) {
  let [a, b, c, d] = [counter & MASK, counter >> 64n, 0n, 0n];
  for (let round = 0; round < 10; round += 1) {
    const first = 0xd2e7470ee14c6c93n * a, second = 0xca5a826395121157n * c;
    [a, b, c, d] = [(second >> 64n) ^ b ^ key0, second & MASK, (first >> 64n) ^ d ^ key1, first & MASK];
    key0 = (key0 + STEP) & MASK;
    key1 = (key1 + 0xbb67ae8584caa73bn) & MASK;
  }
  return [a, b, c, d];
}

// The ziggurat method (Marsaglia and Tsang 2000) for float32, 256 layers, as numpy has it.

const TAIL = 3.6541528853610088, AREA = 0.00492867323397465524494;
const { limit, width, density } = layers();

function layers() {
  const [limit, width, density] = [new Float64Array(256), new Float32Array(256), new Float32Array(256)];
  const gauss = (/** @type {number} */ x) => Math.exp(-0.5 * x * x);
  let edge = TAIL;
  const base = AREA / gauss(edge);
  limit[0] = Math.floor((edge / base) * 2 ** 23);
  width[0] = base / 2 ** 23;
  density[0] = 1;
  width[255] = edge / 2 ** 23;
  density[255] = gauss(edge);
  for (let k = 254; k >= 1; k -= 1) {
    const inner = Math.sqrt(-2 * Math.log(AREA / edge + gauss(edge)));
    limit[k + 1] = Math.floor((inner / edge) * 2 ** 23);
    width[k] = inner / 2 ** 23;
    density[k] = gauss(inner);
    edge = inner;
  }
  return { limit, width, density };
}

/** @param {() => number} next */
function normal(next) {
  const uniform = () => (next() >>> 8) / 2 ** 24;
  for (;;) {
    const bits = next();
    const layer = bits & 0xff, size = (bits >>> 9) & 0x7fffff;
    const x = Math.fround(size * width[layer]) * ((bits >>> 8) & 1 ? -1 : 1);
    if (size < limit[layer]) return x;
    if (layer === 0) {
      for (;;) {
        const over = -Math.log1p(-uniform()) / TAIL, second = -Math.log1p(-uniform());
        if (second + second > over * over) return (size >>> 8) & 1 ? -(TAIL + over) : TAIL + over;
      }
    }
    const between = (density[layer - 1] - density[layer]) * uniform() + density[layer];
    if (between < Math.exp(-0.5 * x * x)) return x;
  }
}
