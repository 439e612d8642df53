// What the patient's page uses of three.js; everything else is left out by the bundler.
export {
  BufferAttribute, BufferGeometry, Color, DirectionalLight, FrontSide, Group, HemisphereLight, LessEqualDepth, Mesh,
  MeshBasicMaterial, MeshLambertMaterial, PerspectiveCamera, Scene, ShaderMaterial, Vector3, WebGLRenderer,
} from "three";
