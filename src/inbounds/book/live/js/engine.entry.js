// MuJoCo's official WebAssembly build, single-threaded: a function that starts it from its bytes.
import load from "@mujoco/mujoco";
export { load };
