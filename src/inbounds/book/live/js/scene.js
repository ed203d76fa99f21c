// Draws a robot with three.js: its geoms are spheres, capsules and a floor. The camera travels with the robot.
"use strict";

inbounds.live.VIEWS = { side: [90, -8], "three-quarter": [130, -18], behind: [180, -15], above: [90, -60] }; // azimuth, elevation [degrees]

inbounds.live.Scene = class {
  // canvas: where to draw; throws where the browser has no WebGL.
  constructor(canvas, world) {
    const three = inbounds.live.three;
    this.canvas = canvas;
    this.world = world;
    this.renderer = new three.WebGLRenderer({ canvas, antialias: true, powerPreference: "low-power" });
    this.scene = new three.Scene();
    this.camera = new three.PerspectiveCamera(45, 4 / 3, 0.05, 100);
    this.camera.up.set(0, 0, 1);
    const sun = new three.DirectionalLight(0xffffff, 2.2);
    sun.position.set(-2, -4, 6);
    this.scene.add(new three.HemisphereLight(0xffffff, 0x8f8a80, 1.8), sun);
    this.meshes = this.geoms();
    this.arrow = new three.ArrowHelper(new three.Vector3(1, 0, 0), new three.Vector3(), 1, 0xe0004d, 0.15, 0.1);
    this.arrow.visible = false;
    this.scene.add(this.arrow);
    this.frame();
    this.view = inbounds.live.VIEWS.side;
    this.follow = null;
  }

  dispose() {
    this.scene.traverse((node) => {
      node.geometry?.dispose();
      node.material?.map?.dispose();
      node.material?.dispose?.();
    });
    this.renderer.dispose();
    this.renderer.forceContextLoss();
  }

  // A mesh for every geom; MuJoCo's geom types are 0 plane, 2 sphere, 3 capsule.
  geoms() {
    const three = inbounds.live.three;
    const { ngeom, geom_type: types, geom_size: sizes, geom_rgba: colors } = this.world.model;
    const meshes = [];
    for (let i = 0; i < ngeom; i++) {
      const [radius, half] = sizes.subarray(3 * i, 3 * i + 3);
      let mesh;
      if (types[i] === 0) {
        mesh = this.floor();
      } else {
        const shape =
          types[i] === 3
            ? new three.CapsuleGeometry(radius, 2 * half, 8, 20).rotateX(Math.PI / 2)
            : new three.SphereGeometry(radius, 24, 16);
        const [r, g, b] = colors.subarray(4 * i, 4 * i + 3);
        const color = new three.Color().setRGB(r, g, b, three.SRGBColorSpace);
        mesh = new three.Mesh(shape, new three.MeshStandardMaterial({ color, roughness: 0.6 }));
      }
      mesh.matrixAutoUpdate = false;
      this.scene.add(mesh);
      meshes.push(mesh);
    }
    return meshes;
  }

  // A chequered floor without end: it moves with the robot by whole squares.
  floor() {
    const three = inbounds.live.three;
    const tile = document.createElement("canvas");
    tile.width = tile.height = 2;
    const paint = tile.getContext("2d");
    ["#c9cfc4", "#b4bcb0", "#b4bcb0", "#c9cfc4"].forEach((color, i) => {
      paint.fillStyle = color;
      paint.fillRect(i % 2, i >> 1, 1, 1);
    });
    const texture = new three.CanvasTexture(tile);
    texture.colorSpace = three.SRGBColorSpace;
    texture.magFilter = three.NearestFilter;
    texture.wrapS = texture.wrapT = three.RepeatWrapping;
    texture.repeat.set(30, 30);
    this.isFloor = new three.Mesh(new three.PlaneGeometry(60, 60), new three.MeshBasicMaterial({ map: texture }));
    return this.isFloor;
  }

  // How far away the camera has to be to see the whole robot, from where its geoms are at rest.
  frame() {
    const centre = this.centre();
    const places = this.world.data.geom_xpos;
    const { geom_type: types, geom_rbound: bounds } = this.world.model;
    let radius = 0.3;
    for (let i = 0; i < this.meshes.length; i++) {
      if (types[i] === 0) continue;
      const away = Math.hypot(...centre.map((c, axis) => places[3 * i + axis] - c));
      radius = Math.max(radius, away + bounds[i]);
    }
    this.distance = (1.25 * radius) / Math.sin((45 * Math.PI) / 360);
    this.height = centre[2];
  }

  centre() {
    return Array.from(this.world.data.subtree_com.subarray(0, 3));
  }

  resize() {
    const { clientWidth: width, clientHeight: height } = this.canvas;
    const ratio = Math.min(devicePixelRatio, 2);
    const size = [width, height, ratio].join();
    if (!width || !height || size === this.size) return;
    this.size = size;
    this.renderer.setPixelRatio(ratio);
    this.renderer.setSize(width, height, false);
    this.camera.aspect = width / height;
    this.camera.updateProjectionMatrix();
  }

  look() {
    const [x, y, z] = this.centre();
    const [azimuth, elevation] = this.view.map((angle) => (angle * Math.PI) / 180);
    const target = [x, y, this.height + 0.5 * (z - this.height)];
    const away = this.distance * Math.cos(elevation);
    this.camera.position.set(
      target[0] - away * Math.cos(azimuth),
      target[1] - away * Math.sin(azimuth),
      target[2] - this.distance * Math.sin(elevation),
    );
    this.camera.lookAt(...target);
    const square = 2; // two squares of the floor are its period [m]
    return [Math.round(x / square) * square, Math.round(y / square) * square];
  }

  draw(background) {
    this.resize();
    const floor = this.look();
    const { geom_xpos: places, geom_xmat: turns } = this.world.data;
    this.meshes.forEach((mesh, i) => {
      const r = turns.subarray(9 * i, 9 * i + 9);
      const p = places.subarray(3 * i, 3 * i + 3);
      const [x, y] = mesh === this.isFloor ? floor : p;
      mesh.matrix.set(r[0], r[1], r[2], x, r[3], r[4], r[5], y, r[6], r[7], r[8], p[2], 0, 0, 0, 1);
    });
    this.drawPush();
    this.renderer.setClearColor(background);
    this.renderer.render(this.scene, this.camera);
  }

  // An arrow where the reader pushes, 0.8 m long for a force of the robot's weight.
  drawPush() {
    const { pushed, totalMass, data } = this.world;
    this.arrow.visible = Boolean(pushed);
    if (!pushed) return;
    const three = inbounds.live.three;
    const force = new three.Vector3(...pushed.force.slice(0, 3));
    const at = data.xpos.subarray(3 * pushed.body, 3 * pushed.body + 3);
    this.arrow.position.set(...at);
    this.arrow.setDirection(force.clone().normalize());
    this.arrow.setLength(Math.max(0.2, (0.8 * force.length()) / (9.81 * totalMass)), 0.15, 0.1);
  }

  // The world's direction of a drag on the picture, right and up [pixels].
  direction(right, up) {
    const three = inbounds.live.three;
    const axes = [new three.Vector3(), new three.Vector3(), new three.Vector3()];
    this.camera.matrixWorld.extractBasis(...axes);
    return axes[0].multiplyScalar(right).addScaledVector(axes[1], up).toArray();
  }
};
