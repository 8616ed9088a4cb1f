/* The motion of a structure whose modes are coupled by stops that hold it or yield to it, or by its own damping.
 *
 *     q'' = f cos(phase) + further sines + held + held_rate u + ... - D q' - W q - sum_k sign_k shape_k F_k
 *
 * A contact force F_k is linear in the penetration and its rate, or a power law, or the force that keeps the contact in
 * place. The solution is a Taylor series, exact to the last bit for any damping and any stiffness. Contacts, forces and
 * their zeros are polynomials in one variable. equations.md 3.4, 6.9, 6.10
 */
#ifndef VIBROIMPACT_COUPLED_FLOW_H
#define VIBROIMPACT_COUPLED_FLOW_H

#include <math.h>

#include "body/modal/state.h"
#include "contact/press.h"
#include "motion/polynomial.h"
#include "motion/rows.h"

/* A row of modes. */
enum { VI_ROW = VI_WHOLE_LANES(VI_MODES) };

typedef struct {
    const vi_structure_model *model;
    double length;                              /* valid for 0 <= u <= length, s */
    int order;                                  /* of the polynomials; VI_ORDER except at a power law's beginning */
    int rooted;                                 /* the polynomials are in the square root of time: entry_flow.h */
    double modal[VI_ORDER + 1][VI_ROW];         /* modal displacements from the start; modal[0] = 0 */
    double penetration[VI_PORTS][VI_ORDER + 1]; /* d of each contact; [0] is its value at the start */
    double force[VI_PORTS][VI_ORDER + 1];       /* F of each contact, N; the last two coefficients are 0 */
    double force_scale[VI_PORTS];               /* sum of the sizes of the terms of a holding force, N */
} vi_drift;

/* Variable of the polynomials after u seconds. */
static inline double vi_drift_variable(const vi_drift *drift, double u)
{
    return drift->rooted ? sqrt(u) : u;
}

/* Start of a drift. */
typedef struct {
    const double *q, *p;
    vi_drive drive;
    const double *penetration; /* of each contact, exact where it touches */
    const double *sign;        /* direction of each contact */
    const vi_press *press;
} vi_drift_start;

void vi_drift_begin(vi_drift *drift, const vi_structure_model *model, const vi_drift_start *start, double length);

/* Modal state after u, from the state at the start. */
void vi_drift_at(const vi_drift *drift, double u, const double q[], double p_end[], double q_end[]);

/* Integral of the force of contact k over u seconds, N s. */
double vi_drift_impulse(const vi_drift *drift, int k, double u);

/* Polynomial of a point's displacement from the start. */
void vi_drift_point(const vi_drift *drift, const double shape[], double polynomial[VI_ORDER + 1]);

#endif
