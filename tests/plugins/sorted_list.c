/* A plugin in C11 that knows nothing but the contract: triangles in a list sorted by where they begin along
 * x, tested by Moeller and Trumbore (1997) in double; a ray that stays at one x skips those beside it. */
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "accel/contract/raybench.h"

typedef struct {
  float lo, hi;
  uint32_t prim;
} Item;

struct rb_tree {
  rb_geometry geometry;
  Item* items;
};

typedef struct {
  uint32_t sorted;
} Config;

static int ByStart(const void* a, const void* b) {
  const Item *x = a, *y = b;
  if (x->lo != y->lo) return x->lo < y->lo ? -1 : 1;
  return x->prim < y->prim ? -1 : x->prim > y->prim;
}

static int Build(const rb_geometry* geometry, const rb_build_options* options, const void* config,
                 rb_tree** tree, char* error, size_t error_size) {
  const uint64_t n = geometry->triangle_count;
  rb_tree* t = malloc(sizeof *t);
  if (options->memory_limit != 0 && n * sizeof(Item) > options->memory_limit) {
    snprintf(error, error_size, "the list needs %llu bytes", (unsigned long long)(n * sizeof(Item)));
    free(t);
    return 1;
  }
  if (t != NULL) t->items = malloc((n + 1) * sizeof(Item));
  if (t == NULL || t->items == NULL) {
    snprintf(error, error_size, "out of memory");
    free(t);
    return 1;
  }
  t->geometry = *geometry;
  for (uint64_t i = 0; i < n; ++i) {
    float lo = INFINITY, hi = -INFINITY;
    for (int k = 0; k < 3; ++k) {
      const float x = geometry->positions[geometry->triangles[i][k]][0];
      lo = fminf(lo, x), hi = fmaxf(hi, x);
    }
    t->items[i] = (Item){lo, hi, (uint32_t)i};
  }
  if (((const Config*)config)->sorted) qsort(t->items, n, sizeof(Item), &ByStart);
  *tree = t;
  return 0;
}

static void Destroy(rb_tree* tree) {
  free(tree->items);
  free(tree);
}

static void Sub(const double a[3], const double b[3], double out[3]) {
  for (int k = 0; k < 3; ++k) out[k] = a[k] - b[k];
}
static void Cross(const double a[3], const double b[3], double out[3]) {
  out[0] = a[1] * b[2] - a[2] * b[1], out[1] = a[2] * b[0] - a[0] * b[2], out[2] = a[0] * b[1] - a[1] * b[0];
}
static double Dot(const double a[3], const double b[3]) { return a[0] * b[0] + a[1] * b[1] + a[2] * b[2]; }

static void TestTriangle(const rb_geometry* g, uint32_t prim, const rb_ray* ray, rb_hit* best) {
  double p[3][3], org[3], dir[3], e1[3], e2[3], h[3], s[3], q[3];
  for (int c = 0; c < 3; ++c) {
    org[c] = ray->org[c], dir[c] = ray->dir[c];
    for (int k = 0; k < 3; ++k) p[c][k] = g->positions[g->triangles[prim][c]][k];
  }
  Sub(p[1], p[0], e1), Sub(p[2], p[0], e2), Sub(org, p[0], s);
  Cross(dir, e2, h), Cross(s, e1, q);
  const double det = Dot(e1, h);
  if (det == 0) return;
  const double u = Dot(s, h) / det, v = Dot(dir, q) / det;
  const float t = (float)(Dot(e2, q) / det);
  if (u < 0 || v < 0 || u + v > 1 || !(t > ray->tnear) || t > ray->tfar) return;
  if (t < best->t || (t == best->t && prim < best->prim)) *best = (rb_hit){t, (float)u, (float)v, prim};
}

static void Answer(const rb_tree* tree, const rb_query* query, int count) {
  for (size_t i = 0; i < query->n; ++i) {
    const rb_ray* ray = &query->rays[i];
    rb_hit best = {ray->tfar, 0, 0, RAYBENCH_NONE};
    uint64_t steps = 0, tests = 0;
    const uint32_t skip = query->skip != NULL ? query->skip[i] : RAYBENCH_NONE;
    for (uint64_t k = 0; k < tree->geometry.triangle_count; ++k) {
      const Item* item = &tree->items[k];
      ++steps;
      if (ray->dir[0] == 0 && (item->lo > ray->org[0] || item->hi < ray->org[0])) continue;
      if (item->prim == skip) continue;
      ++tests;
      TestTriangle(&tree->geometry, item->prim, ray, &best);
      if (query->kind == RB_ANY && best.prim != RAYBENCH_NONE) break;
    }
    if (query->kind == RB_ANY) {
      query->occluded[i] = best.prim != RAYBENCH_NONE;
    } else {
      query->hits[i] = best;
    }
    if (count) query->counts[i] = (rb_counts){steps, 1, 0, steps, tests, steps * sizeof(Item)};
  }
}

static void Query(const rb_tree* tree, const rb_query* query) { Answer(tree, query, 0); }
static void QueryCounted(const rb_tree* tree, const rb_query* query) { Answer(tree, query, 1); }
static uint32_t Claims(const rb_tree* tree) {
  (void)tree;
  return RB_CLAIM_INEXACT;
}
static void Memory(const rb_tree* tree, uint64_t* nodes, uint64_t* prims, int* needs_geometry) {
  *nodes = tree->geometry.triangle_count * sizeof(Item);
  *prims = 0;
  *needs_geometry = 1;
}

static const rb_param kParams[] = {
    {"sorted", "sort the list", RB_BOOL, 0, offsetof(Config, sorted), 0, 0, 1, 1, NULL}};

static const rb_structure kSortedList = {RAYBENCH_ABI_VERSION,
                                         sizeof(rb_structure),
                                         "sorted_list",
                                         "triangles in a list, sorted along x",
                                         "raybench's tests",
                                         RB_CAN_COUNT | RB_CAN_SKIP | RB_DETERMINISTIC,
                                         kParams,
                                         1,
                                         sizeof(Config),
                                         &Build,
                                         &Destroy,
                                         &Query,
                                         &QueryCounted,
                                         &Claims,
                                         &Memory,
                                         NULL};

const rb_structure* const* raybench_plugin(uint32_t host_abi, size_t* count);
const rb_structure* const* raybench_plugin(uint32_t host_abi, size_t* count) {
  static const rb_structure* const all[] = {&kSortedList};
  *count = 1;
  return host_abi == RAYBENCH_ABI_VERSION ? all : NULL;
}
