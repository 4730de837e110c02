// What the shaders of the path `pipeline` tell each other.
struct Payload {
  Hit hit;
  bool collects;  // nothing is accepted, so nothing is culled, and `hit` becomes the first in (t, prim) order
};

// u and v of a hit; procedural primitives have none.
vec2 AttributesOf(uint hit_kind, vec2 uv) { return hit_kind >= 0xFE ? uv : vec2(0); }
