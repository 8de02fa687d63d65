import DracoDecoderModule from "./draco_wasm_wrapper.cjs";
import wasmBinary from "three/examples/jsm/libs/draco/gltf/draco_decoder.wasm";

/** Draco's decoder, when it is ready. */
export const dracoDecoder = () => DracoDecoderModule({ wasmBinary });
