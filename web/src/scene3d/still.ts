// A picture of everything that rests, with its depth: while only the hand moves, a frame costs a copy of it and the markers.
// Its colours are encoded as those of the canvas, so that a copy converts nothing and blending is the same in both.
import {
  DepthTexture,
  LinearFilter,
  Mesh,
  NearestFilter,
  OrthographicCamera,
  type PerspectiveCamera,
  PlaneGeometry,
  Scene,
  ShaderMaterial,
  SRGBColorSpace,
  UnsignedIntType,
  Vector2,
  type WebGLRenderer,
  WebGLRenderTarget,
} from "three";

const COPY = /* glsl */ `
uniform sampler2D colour;
uniform sampler2D depth;
varying vec2 at;
void main() {
  gl_FragColor = texture2D(colour, at);
  gl_FragDepth = texture2D(depth, at).r;
}`;

export class Still {
  private readonly target: WebGLRenderTarget;
  private readonly copy = new Scene();
  private readonly camera = new OrthographicCamera(-1, 1, 1, -1, 0, 1);

  constructor(
    private readonly renderer: WebGLRenderer,
    samples: number,
  ) {
    this.target = new WebGLRenderTarget(1, 1, {
      colorSpace: SRGBColorSpace,
      internalFormat: "RGBA8",
      minFilter: LinearFilter,
      magFilter: NearestFilter,
      depthTexture: new DepthTexture(1, 1, UnsignedIntType),
      samples,
    });
    // three.js encodes colours for the canvas and for such a target only.
    Object.assign(this.target, { isXRRenderTarget: true });
    const material = new ShaderMaterial({
      uniforms: { colour: { value: this.target.texture }, depth: { value: this.target.depthTexture } },
      vertexShader: "varying vec2 at; void main() { at = uv; gl_Position = vec4(position.xy, 0.0, 1.0); }",
      fragmentShader: COPY,
    });
    const square = new Mesh(new PlaneGeometry(2, 2), material);
    square.frustumCulled = false;
    this.copy.add(square);
  }

  /** Takes the picture. */
  take(scene: Scene, camera: PerspectiveCamera): void {
    const size = this.renderer.getDrawingBufferSize(new Vector2());
    this.target.setSize(size.x, size.y);
    this.renderer.setRenderTarget(this.target);
    this.renderer.autoClear = true;
    this.renderer.render(scene, camera);
    this.renderer.setRenderTarget(null);
  }

  /** Copies colour and depth onto the canvas; what is drawn next stands before or behind it. */
  show(): void {
    this.renderer.autoClear = false;
    this.renderer.clear();
    this.renderer.render(this.copy, this.camera);
  }
}

/** Whether a program draws instead of a graphics card. */
export function drawsInSoftware(): boolean {
  const gl = document.createElement("canvas").getContext("webgl2");
  if (!gl) return false;
  const info = gl.getExtension("WEBGL_debug_renderer_info");
  const name = String(gl.getParameter(info ? info.UNMASKED_RENDERER_WEBGL : gl.RENDERER));
  gl.getExtension("WEBGL_lose_context")?.loseContext();
  return /swiftshader|llvmpipe|softpipe|software|basic render/i.test(name);
}
