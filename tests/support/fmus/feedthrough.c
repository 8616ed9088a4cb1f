/* Direct feedthrough of several laws, y = law(u) + l w, with directional derivatives that may lie. Another output depends
 * on u until initialization has ended. */
#include <math.h>

#include "model.h"

enum { U = 1, W, Y, LATCHED, LAW, K, L, B, LIE };
enum { LINEAR, COSINE, SQUARE, ROOT, OFF_ABOVE };
enum { DONE = 0, REFUSED = 3 };

const bool model_has_state = true;
const bool model_has_event_mode = false;

void model_start(model *m)
{
    *m = (model){.value = {[K] = 1.0}};
}

bool model_begin(model *m, void *instance)
{
    (void)instance;
    m->says_early = true; /* initialization has ended; no step here says so */
    return true;
}

static double law(const model *m, double u)
{
    switch ((int)m->value[LAW]) {
    case COSINE:
        return cos(u);
    case SQUARE:
        return m->value[K] * u * u + m->value[B];
    case ROOT:
        return sqrt(u) + m->value[B];
    case OFF_ABOVE:
        return u > m->value[B] ? 0.0 : 1.0;
    default:
        return m->value[K] * u + m->value[B];
    }
}

static double slope(const model *m, double u)
{
    switch ((int)m->value[LAW]) {
    case COSINE:
        return -sin(u);
    case SQUARE:
        return 2.0 * m->value[K] * u;
    case ROOT:
        return 0.5 / sqrt(u);
    case OFF_ABOVE:
        return 0.0;
    default:
        return m->value[K];
    }
}

void model_calculate(model *m)
{
    const double u = m->value[U];
    m->value[Y] = law(m, u) + m->value[L] * m->value[W];
    if (!m->says_early) {
        m->value[LATCHED] = m->value[K] * u + m->value[B];
    }
}

step_answer model_step(model *m, double size, void *instance)
{
    (void)m, (void)size, (void)instance;
    return STEP_DONE;
}

bool model_update(model *m)
{
    (void)m;
    return false;
}

/* The root of a negative number is discarded. */
step_answer model_at(model *m, occasion where, void *instance)
{
    (void)instance;
    const bool has_no_root = m->value[LAW] == ROOT && m->value[U] < 0.0;
    return where == AT_GET && has_no_root ? STEP_DISCARDS : STEP_DONE;
}

/* ---- derivatives: the first member of an instance is its model, in both adapters ---- */

static int derivatives(const model *m, const unsigned unknowns[], size_t count, const unsigned knowns[],
                       size_t known_count, const double seeds[], double found[])
{
    for (size_t i = 0; i < count; i++) {
        found[i] = 0.0;
        for (size_t j = 0; j < known_count; j++) {
            if (unknowns[i] != Y || (knowns[j] != U && knowns[j] != W)) {
                return REFUSED;
            }
            found[i] += seeds[j] * (knowns[j] == U ? slope(m, m->value[U]) + m->value[LIE] : m->value[L]);
        }
    }
    return m->value[LIE] < 0.0 ? REFUSED : DONE;
}

int fmi2GetDirectionalDerivative(void *c, const unsigned unknowns[], size_t count, const unsigned knowns[],
                                 size_t known_count, const double seeds[], double found[]);
int fmi2GetDirectionalDerivative(void *c, const unsigned unknowns[], size_t count, const unsigned knowns[],
                                 size_t known_count, const double seeds[], double found[])
{
    return derivatives(c, unknowns, count, knowns, known_count, seeds, found);
}

int fmi3GetDirectionalDerivative(void *c, const unsigned unknowns[], size_t count, const unsigned knowns[],
                                 size_t known_count, const double seeds[], size_t seed_count, double found[],
                                 size_t found_count);
int fmi3GetDirectionalDerivative(void *c, const unsigned unknowns[], size_t count, const unsigned knowns[],
                                 size_t known_count, const double seeds[], size_t seed_count, double found[],
                                 size_t found_count)
{
    const bool fits = seed_count == known_count && found_count == count;
    return fits ? derivatives(c, unknowns, count, knowns, known_count, seeds, found) : REFUSED;
}
