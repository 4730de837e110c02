/* raybench plugin contract, version 1. Compiles as C11 and as C++20; depends on nothing.
 *
 * A structure is one constant table of function pointers, rb_structure. Built-in structures, third-party
 * libraries and plugins loaded from a shared library go through this table and nothing else. C++ authors
 * need not fill it in by hand: accel/contract/structure.h stamps it from a class.
 *
 * What the host promises: positions and ray components are finite; max |coordinate| lies in
 * [2^-30, 2^30]; no triangle is degenerate (its three vertices are never exactly collinear); indices are in
 * range; the geometry outlives the tree; tnear is finite and >= 0; dir is not zero.
 * What a structure promises: a hit counts if tnear < t <= tfar; of hits at the same computed t the lowest
 * primitive id wins; query() may be called from many threads at once and starts none; the same input,
 * parameters and seed give the same tree at any thread count (flag RB_DETERMINISTIC). */
#ifndef RAYBENCH_H
#define RAYBENCH_H

#include <stddef.h>
#include <stdint.h>

#ifdef __cplusplus
extern "C" {
#endif

/* Changed when a field changes meaning or an array element changes size; other structs grow at the end. */
#define RAYBENCH_ABI_VERSION 1u
#define RAYBENCH_NONE 0xFFFFFFFFu

/* A ray org + t dir, t in (tnear, tfar]. dir has any length but zero; t is measured in lengths of dir. */
typedef struct {
  float org[3], tnear, dir[3], tfar;
} rb_ray;

/* The hit point is (1-u-v) p0 + u p1 + v p2. Miss: prim == RAYBENCH_NONE and t == tfar.
 * Without RB_NEED_UV in the build options u and v may be left undefined. */
typedef struct {
  float t, u, v;
  uint32_t prim;
} rb_hit;

/* What one ray cost. A wide node is one step and k bounds. Havran (2000) names them N_TS (steps),
 * N_ETS (leaves), N_EETS (empty_leaves), N_IT (prims, repeats included). */
typedef struct {
  uint64_t steps;        /* nodes or cells traversed, leaves included */
  uint64_t leaves;       /* leaves or elementary cells traversed */
  uint64_t empty_leaves; /* those of them without a primitive */
  uint64_t bounds;       /* ray-bounds or ray-plane tests */
  uint64_t prims;        /* ray-primitive tests */
  uint64_t bytes;        /* bytes of nodes and primitives touched */
} rb_counts;

/* Procedural primitives as data. A sphere's surface, and a truncated cone's side without its discs (with equal
 * radii a cylinder, with one radius 0 a cone to its apex): negative radii show only the inside. A polygon's
 * corners are `count` vertex indices from `first` on; inside is what they enclose an odd number of times. */
typedef struct {
  float center[3], radius;
} rb_sphere;
typedef struct {
  float base[3], base_radius, apex[3], apex_radius;
} rb_cone;
typedef struct {
  uint32_t first, count;
} rb_polygon;

/* Borrowed geometry. Primitive ids: triangles 0 .. triangle_count-1, then the procedural primitives. */
typedef struct {
  uint32_t struct_size, reserved;
  const float (*positions)[3]; /* 16 readable bytes follow the last position */
  uint64_t vertex_count;
  const uint32_t (*triangles)[3];
  uint64_t triangle_count;
  uint64_t procedural_count;
  /* Bounds of procedural primitive i (0-based), rounded outward. */
  void (*procedural_bounds)(const void* user, uint64_t i, float lo[3], float hi[3]);
  /* Nearest hit of primitive i with tnear < t <= tfar: fills t, u, v and returns 1, else returns 0. It is
   * given RB_CLOSEST rays only and does not touch hit->prim. `numerics` is the build parameter's index. */
  int (*procedural_intersect)(const void* user, uint64_t i, uint32_t numerics, const rb_ray* ray,
                              rb_hit* hit);
  const void* procedural_user;
  /* The same primitives as data, for a structure whose device cannot call back: spheres, then cones, then
   * polygons. Either all of them are here or none (see struct_size, too). */
  const rb_sphere* spheres;
  const rb_cone* cones;
  const rb_polygon* polygons;
  const uint32_t* polygon_vertices;
  uint64_t sphere_count, cone_count, polygon_count, polygon_vertex_count;
} rb_geometry;

/* What the scene requires of the structure; it may keep and do less when less is needed. */
enum { RB_NEED_UV = 1, RB_NEED_ANY = 2, RB_NEED_AFTER = 4, RB_NEED_SKIP = 8 };

typedef struct {
  uint32_t struct_size;
  uint32_t threads; /* at most this many threads may build; at least 1 */
  uint64_t seed;
  uint64_t needs;             /* RB_NEED_* */
  uint64_t memory_limit;      /* bytes the tree and its building may take; 0: no limit */
  const volatile int* cancel; /* NULL, or becomes non-zero when the build shall stop with an error */
} rb_build_options;

/* A build parameter, described beside the code that uses it. It is stored in the config block at `offset`
 * as uint32_t (RB_BOOL), int64_t (RB_INT), double (RB_FLOAT) or uint32_t, an index of `choices` (RB_CHOICE).
 */
enum { RB_BOOL, RB_INT, RB_FLOAT, RB_CHOICE };
enum {
  RB_PARAM_LOG = 1,
  RB_PARAM_APPROXIMATE = 2,
  RB_PARAM_SPEED_ONLY = 4 /* neither the tree nor any answer depends on it */
};
typedef struct {
  const char *name, *doc;
  uint32_t type, flags, offset, reserved;
  double lo, hi, def;         /* inclusive range and default; for RB_CHOICE def is the index */
  const char* const* choices; /* RB_CHOICE: names, closed by NULL; else NULL */
} rb_param;

enum {
  RB_CAN_COUNT = 1,
  RB_CAN_PROCEDURAL = 2,
  RB_CAN_AFTER = 4,
  RB_CAN_SKIP = 8,
  RB_NATIVE_BATCH = 16, /* rays of a batch are traced together (packets, streams) */
  RB_DETERMINISTIC = 32,
  RB_LINEAR = 64, /* every ray looks at every primitive: runs leave it out where that takes too long */
  RB_DEVICE = 128 /* works on a device of its own, which the processor's clocks do not see: see rb_device */
};

/* What a built tree claims about its answers. A broken claim fails a run.
 * INEXACT: error rates are measured. WATERTIGHT: no leak, no plain (non-marginal) error, and the u and v of
 * triangles within float's error. EXACT: the truth on every ray, with such u and v. */
enum { RB_CLAIM_NOTHING, RB_CLAIM_INEXACT, RB_CLAIM_WATERTIGHT, RB_CLAIM_EXACT };

/* One node, shown by visit() in pre-order. bounds of a box: lo x y z, hi x y z; of a sphere: centre, radius;
 * of a k-DOP: k/2 lower ends, then k/2 upper ones, along x, y, z and the directions that
 * accel/bvh/bounds/kdop.h lists for k = bounds_count. */
enum { RB_SHAPE_BOX, RB_SHAPE_SPHERE, RB_SHAPE_KDOP };
typedef struct {
  uint32_t depth, is_leaf; /* root: depth 0 */
  uint32_t
      space_partition; /* 0: the leaf's bounds enclose its primitives; 1: the leaves together cover them */
  uint32_t shape;
  const float* bounds;
  uint32_t bounds_count, prim_count; /* floats in bounds; primitives referenced by a leaf */
  const uint32_t* prims;
} rb_node;

typedef struct rb_tree rb_tree;

/* What a device did for a tree since its building began: seconds by the device's own clock, copies to and from
 * its memory apart. A software driver stands in for a device on the processor. */
typedef struct {
  uint32_t struct_size, is_software;
  const char* name; /* of device and driver; lives as long as the tree */
  double build, build_copies, query, query_copies;
} rb_device;

enum { RB_CLOSEST, RB_ANY };
typedef struct {
  uint32_t struct_size, kind;
  size_t n;
  const rb_ray* rays;
  const uint32_t* skip;  /* NULL, or per ray one *flat* primitive that is not hit (or RAYBENCH_NONE) */
  const uint32_t* after; /* NULL, or per ray: a hit counts if t > tnear, or t == tnear and prim > after */
  rb_hit* hits;          /* kind == RB_CLOSEST: n results */
  uint8_t* occluded;     /* kind == RB_ANY: n results, 0 or 1 */
  rb_counts* counts;     /* query_counted only: n results, overwritten */
} rb_query;

typedef struct {
  uint32_t abi_version, struct_size; /* stay first for ever */
  const char* name;                  /* [a-z][a-z0-9_]*; the key in every result file */
  const char* doc;                   /* one line */
  const char* source;                /* paper or URL */
  uint64_t capabilities;             /* RB_CAN_* and the two flags after them */
  const rb_param* params;
  uint32_t param_count, config_size;
  /* Returns 0 and sets *tree, or returns non-zero and writes one line into error. */
  int (*build)(const rb_geometry*, const rb_build_options*, const void* config, rb_tree** tree, char* error,
               size_t error_size);
  void (*destroy)(rb_tree*);
  void (*query)(const rb_tree*, const rb_query*);
  void (*query_counted)(const rb_tree*, const rb_query*); /* NULL without RB_CAN_COUNT */
  uint32_t (*claims)(const rb_tree*);                     /* RB_CLAIM_* of this very tree */
  /* Bytes of nodes, bytes of copied primitives, and whether queries still read the borrowed geometry. */
  void (*memory)(const rb_tree*, uint64_t* nodes, uint64_t* prims, int* needs_geometry);
  /* Calls node() for every node in pre-order until it returns non-zero, and returns that. May be NULL. */
  int (*visit)(const rb_tree*, int (*node)(void* ctx, const rb_node*), void* ctx);
  /* RB_DEVICE only; both may be NULL. */
  const char* (*unavailable)(void); /* one line that says why nothing can be built here; NULL: it can */
  void (*device)(const rb_tree*, rb_device*);
} rb_structure;

/* A plugin library exports this function. It returns `count` tables, or NULL if it cannot serve host_abi. */
#define RAYBENCH_PLUGIN_ENTRY "raybench_plugin"
typedef const rb_structure* const* (*rb_plugin_entry)(uint32_t host_abi, size_t* count);

#ifdef __cplusplus
}
#endif
#endif
