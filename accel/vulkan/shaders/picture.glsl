// A picture that is traced in waves on the device (accel/vulkan/picture.h has the same structs).
struct Material {
  vec3 diffuse, specular, emission, reflect, transmit, dispersion;
  float shininess, ior;
  bool fresnel, thin;
};
struct Light {
  vec3 position, intensity, direction;
  float cos_inner, cos_outer, range;
  uint kind;  // 0 point, 1 directional, 2 spot
  bool falloff;
};
struct Path {
  vec3 weight;
  uint sample_index;
  Ray ray;
};
// The rays of one depth: how many workgroups trace them, for vkCmdDispatchIndirect, and what was counted.
struct Wave {
  uint x, y, z;
  uint rays, hits, shadow, blocked, reflections, refractions;
};

layout(buffer_reference, scalar) readonly buffer Materials { Material at[]; };
layout(buffer_reference, scalar) readonly buffer Lights { Light at[]; };
layout(buffer_reference, scalar) buffer Paths { Path at[]; };
layout(buffer_reference, scalar) buffer Waves { Wave at[]; };
layout(buffer_reference, scalar) buffer Sums { uint at[]; };
layout(buffer_reference, scalar) readonly buffer PictureData {
  Materials materials;
  Numbers materials_of;  // of each primitive
  Positions positions, normals;
  Numbers triangles;
  Lights lights;
  Sums sums;       // of each sample: three colours in fixed point, 32 bits before and 32 after the point
  Paths paths[2];  // those of even and of odd waves
  Waves waves;
  uint light_count, max_depth, capacity, fresnel;  // fresnel: 0 as the material says, 1 off, 2 on
  bool smooth_normals, gathers, shadow_rays;
  float min_contribution;
  vec3 ambient, background;
};

layout(push_constant, scalar) uniform Push {
  uvec2 tlas;
  SceneData scene;
  PictureData picture;
  uint wave;
} push;
