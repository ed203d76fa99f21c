// What of three.js the live robot draws with; esbuild leaves out the rest.
export {
  ArrowHelper, CanvasTexture, CapsuleGeometry, Color, DirectionalLight, HemisphereLight, Mesh, MeshBasicMaterial,
  MeshStandardMaterial, NearestFilter, PerspectiveCamera, PlaneGeometry, RepeatWrapping, Scene, SphereGeometry,
  SRGBColorSpace, Vector3, WebGLRenderer,
} from "three";
