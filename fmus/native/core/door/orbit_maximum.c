#include "door/orbit_maximum.h"

#include <math.h>
#include <string.h>

#include "modes/growth.h"
#include "motion/majorant.h"

/* Least step of the search for maxima, as a share of the flight's length. */
static const double LEAST_STEP = 1e-13;

/* A contact in a flight: distance beyond its stop, the first two derivatives, and a bound of the third from here on. */
typedef struct {
    double beyond, velocity, acceleration, bound;
    double horizon; /* time for which the bound holds, s */
} seen;

/* A contact in a flight: the free motion of the modes, which adds to the steady one, at its start. */
typedef struct {
    const vi_orbit_response *response;
    int contact;
    double phase;
    double growth; /* rate above which no motion of the modes grows, 1/s: equations.md 1.9 */
    vi_orbit_gap steady;
    double x[VI_MODES], v[VI_MODES];
    vi_complex weight[VI_TERMS]; /* coupled: displacement of the contact by each term */
} flight;

/* Begin a flight in modal `state` at forcing phase `phase`. */
static void begin(flight *own, const vi_orbit_response *response, int contact, const double state[], double phase)
{
    const vi_orbit_body *body = response->body;
    const double *shape = body->shape + (ptrdiff_t)contact * body->modes;
    own->response = response;
    own->contact = contact;
    own->phase = phase;
    own->growth = vi_growth_of(body->coupling ? 0 : body->modes, response->mode, NULL);
    if (body->coupling) {
        const vi_pressed_body *coupled = &body->coupling->body;
        own->growth = vi_growth_of(coupled->modes, response->mode + response->loose, coupled->coupling);
    }
    vi_orbit_steady_gap(response, contact, &own->steady);
    vi_orbit_steady(response, phase, own->x, own->v);
    for (int j = 0; j < body->modes; ++j) {
        own->x[j] = state[j] - own->x[j];
        own->v[j] = state[body->modes + j] - own->v[j];
    }
    if (!body->coupling || body->coupling->terms.terms == 0) {
        return;
    }
    const vi_pressed_modes *terms = &body->coupling->terms;
    const int loose = response->loose;
    vi_pressed_parts(terms, own->x + loose, own->v + loose, own->weight);
    for (int m = 0; m < terms->terms; ++m) {
        vi_complex moved = {0.0, 0.0};
        for (int j = loose; j < body->modes; ++j) {
            moved = vi_complex_add(moved, vi_complex_scale(shape[j], terms->vector[m][j - loose]));
        }
        own->weight[m] = vi_complex_multiply(own->weight[m], moved);
    }
}

/* Free motion of the contact by coupled modes `u` seconds after the start, by terms e^(rate u). */
static seen coupled_motion(const flight *own, double u)
{
    const vi_orbit_coupling *coupling = own->response->body->coupling;
    vi_complex turn[VI_TERMS];
    seen sum = {0.0, 0.0, 0.0, 0.0, HUGE_VAL};
    vi_orbit_turns(coupling, u, turn);
    for (int m = 0; m < coupling->terms.terms; ++m) {
        const vi_complex rate = coupling->terms.rate[m], x = vi_complex_multiply(own->weight[m], turn[m]);
        const vi_complex v = vi_complex_multiply(rate, x), a = vi_complex_multiply(rate, v);
        sum.beyond += x.re;
        sum.velocity += v.re;
        sum.acceleration += a.re;
        sum.bound += vi_complex_size(rate) * vi_complex_size(a);
    }
    return sum;
}

/* The same next to critical damping, by series. The third derivative is (D D s - W s).v + (D s).W x at the contact's
 * shape s. The sum v.v + x.|W| x grows at most at the rate of the modes. */
static seen series_motion(const flight *own, double u)
{
    const vi_orbit_response *response = own->response;
    const vi_orbit_body *body = response->body;
    const double *shape = body->shape + (ptrdiff_t)own->contact * body->modes;
    double x[VI_MODES], v[VI_MODES], drag[VI_MODES], once[VI_MODES], twice[VI_MODES], square = 0.0, energy = 0.0;
    memcpy(x, own->x, (size_t)body->modes * sizeof *x);
    memcpy(v, own->v, (size_t)body->modes * sizeof *v);
    vi_orbit_free(response, u, x, v);
    vi_orbit_drag(response, v, drag);
    vi_orbit_drag(response, shape, once);
    vi_orbit_drag(response, once, twice);
    seen sum = {0.0, 0.0, 0.0, 0.0, HUGE_VAL};
    for (int j = response->loose; j < body->modes; ++j) {
        const double stiffness = response->mode[j].stiffness, along = twice[j] - stiffness * shape[j];
        sum.beyond += shape[j] * x[j];
        sum.velocity += shape[j] * v[j];
        sum.acceleration -= shape[j] * (stiffness * x[j] + drag[j]);
        square += along * along + fabs(stiffness) * once[j] * once[j];
        energy += v[j] * v[j] + fabs(stiffness) * x[j] * x[j];
    }
    sum.bound = sqrt(square * energy);
    return sum;
}

/* Free motion of the contact by the first `modes` modes `u` seconds after the start, mode by mode. A constant force moves
 * a mode without a spring, and has no third derivative. */
static seen free_motion(const flight *own, int modes, double u)
{
    const vi_orbit_body *body = own->response->body;
    const double *shape = body->shape + (ptrdiff_t)own->contact * body->modes;
    seen sum = {0.0, 0.0, 0.0, 0.0, HUGE_VAL};
    for (int j = 0; j < own->response->loose; ++j) {
        sum.beyond += shape[j] * 0.5 * u * u * body->held[j];
        sum.velocity += shape[j] * u * body->held[j];
        sum.acceleration += shape[j] * body->held[j];
    }
    for (int j = 0; j < modes; ++j) {
        const vi_mode *mode = &own->response->mode[j];
        const double x = own->x[j], v = own->v[j];
        double phi[4];
        vi_mode_propagator(mode, u, phi);
        const double moved = phi[0] * x + phi[1] * v, faster = phi[2] * x + phi[3] * v;
        const double drag = 2.0 * mode->decay;
        sum.beyond += shape[j] * moved;
        sum.velocity += shape[j] * faster;
        sum.acceleration -= shape[j] * (mode->stiffness * moved + drag * faster);
        /* |x'''| = |(4 c^2 - k) v + 2 c k x|; v^2 + |k| x^2 grows at most at the rate of the modes */
        sum.bound += fabs(shape[j]) * (fabs(drag * drag - mode->stiffness) + fabs(drag) * mode->natural)
                     * sqrt(faster * faster + mode->natural * mode->natural * moved * moved);
    }
    return sum;
}

/* Find the motion of the contact relative to its stop `u` seconds after the start. */
static seen look(const flight *own, double u)
{
    const vi_orbit_response *response = own->response;
    const vi_orbit_body *body = response->body;
    const double angle = own->phase + body->angular_frequency * u;
    seen sum = free_motion(own, body->coupling ? response->loose : body->modes, u);
    if (body->coupling) {
        const seen more = body->coupling->terms.terms == 0 ? series_motion(own, u) : coupled_motion(own, u);
        sum = (seen){sum.beyond + more.beyond, sum.velocity + more.velocity, sum.acceleration + more.acceleration,
                     sum.bound + more.bound, HUGE_VAL};
    }
    if (own->growth > 0.0) { /* the bound is multiplied by e^(growth horizon) */
        sum.horizon = 1.0 / own->growth;
        sum.bound *= exp(1.0);
    }
    sum.beyond += own->steady.level;
    for (int k = 0; k < body->harmonics; ++k) {
        const double w = body->order[k] * body->angular_frequency;
        const double c = cos(body->order[k] * angle), s = sin(body->order[k] * angle);
        const double cosine = own->steady.cosine[k], sine = own->steady.sine[k];
        sum.beyond = sum.beyond + cosine * c + sine * s;
        sum.velocity += w * (sine * c - cosine * s);
        sum.acceleration -= w * w * (cosine * c + sine * s);
        sum.bound += w * w * w * sqrt(cosine * cosine + sine * sine);
    }
    const double direction = body->direction[own->contact];
    sum.beyond = direction * (sum.beyond - body->position[own->contact]);
    sum.velocity *= direction;
    sum.acceleration *= direction;
    return sum;
}

static void keep(double what[3], double beyond, double phase, int contact)
{
    if (beyond > what[0]) {
        what[0] = beyond;
        what[1] = phase;
        what[2] = contact;
    }
}

/* Find all maxima of a contact within a flight of `length` seconds; returns its velocity at the end. Certified steps
 * end before a zero of the velocity, so its sign changes only over least steps. */
static double search(const vi_orbit_response *response, int contact, const double state[], double phase, double length,
                     double what[3])
{
    const double w = response->body->angular_frequency;
    flight own;
    begin(&own, response, contact, state, phase);
    seen now = look(&own, 0.0);
    double u = 0.0;
    for (int evaluation = 0; u < length; ++evaluation) {
        const double away = now.velocity > 0.0 ? -now.acceleration : now.acceleration;
        const double certain = vi_parabola_root(fabs(now.velocity), away, now.bound);
        u = fmin(u + fmax(fmin(certain, now.horizon), vi_least_step(length, LEAST_STEP, evaluation)), length);
        const seen next = look(&own, u);
        if (now.velocity > 0.0 && next.velocity <= 0.0) {
            keep(what, fmax(now.beyond, next.beyond), phase + w * u, contact);
        }
        now = next;
    }
    return now.velocity;
}

VI_DOOR int vi_door_orbit_maximum(const vi_orbit_body *body, const vi_orbit_train *train, const double state[],
                                  double what[3])
{
    vi_orbit_response response;
    const int refused = vi_orbit_respond(&response, body, train);
    what[0] = -HUGE_VAL;
    what[1] = 0.0;
    what[2] = -1.0;
    if (refused != VI_ORBIT_DONE) {
        return refused;
    }
    const int states = 2 * body->modes, n = train->impacts;
    for (int i = 0; i < n; ++i) {
        const int next = (i + 1) % n;
        const double *start = state + (ptrdiff_t)i * states, *after = state + (ptrdiff_t)next * states;
        for (int contact = 0; contact < body->contacts; ++contact) {
            const double length = vi_orbit_since(&response, next, i);
            const double arriving = search(&response, contact, start, train->phase[i], length, what);
            /* an impact elsewhere may reverse this contact */
            if (contact != train->contact[next] && arriving > 0.0) {
                flight leaving;
                begin(&leaving, &response, contact, after, train->phase[next]);
                const seen left = look(&leaving, 0.0);
                if (left.velocity <= 0.0) {
                    keep(what, left.beyond, train->phase[next], contact);
                }
            }
        }
    }
    return VI_ORBIT_DONE;
}
