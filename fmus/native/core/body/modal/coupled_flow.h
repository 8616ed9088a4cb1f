/* The motion of a structure whose modes are coupled: by stops that hold it or yield to it, or by its own damping.
 *
 *     q'' = f cos(phase) + held + held_rate u - D q' - W q - sum_k sign_k shape_k F_k
 *
 * with each contact force F_k linear in the penetration and its rate, or a power of it, or whatever keeps the contact
 * where it is. A Taylor series to the last bit, straight from the equation: exact for any damping and any stiffness, and
 * contacts, forces and their zeros are polynomials in one variable. equations.md 3.4, 6.9, 6.10
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
    int order;                                  /* of the polynomials; VI_ORDER but for the first touch of a power law */
    int rooted;                                 /* they are polynomials of the square root of time: entry_flow.h */
    double modal[VI_ORDER + 1][VI_ROW];         /* modal displacements from the start; modal[0] = 0 */
    double penetration[VI_PORTS][VI_ORDER + 1]; /* d of each contact; [0] is its value at the start */
    double force[VI_PORTS][VI_ORDER + 1];       /* F of each contact, N; the last two coefficients are 0 */
    double force_scale[VI_PORTS];               /* of holding forces: size of the terms added up, N */
} vi_drift;

/* What its polynomials are of, after u seconds. */
static inline double vi_drift_variable(const vi_drift *drift, double u)
{
    return drift->rooted ? sqrt(u) : u;
}

/* What a drift starts from. */
typedef struct {
    const double *q, *p;
    double cosine, sine; /* of the forcing phase */
    const double *held, *held_rate;
    const double *penetration; /* of each contact, exact where it is known */
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
