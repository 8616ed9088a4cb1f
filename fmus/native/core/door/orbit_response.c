#include "door/orbit_response.h"

#include <float.h>
#include <math.h>
#include <stdbool.h>
#include <string.h>

#include "contact/contact_law.h"
#include "motion/magnitude.h"

static const double TURN = 6.283185307179586;
/* Fastest rate of coupled modes over the angular frequency of the force. Above, no series follows them: a period would
 * take more than 1e6 steps. */
static const double MOST_OF_SERIES = 1e5;
/* Derivative of r(V) V over r(V) above the yield velocity, where r falls as V^(-1/4). */
static const double FALLING = 0.75;

static bool is_finite(int count, const double values[])
{
    double sum = 0.0; /* 0, or NaN */
    for (int j = 0; j < count; ++j) {
        sum += 0.0 * values[j];
    }
    return sum == 0.0;
}

static bool is_body(const vi_orbit_body *body)
{
    bool good = body->modes >= 1 && body->modes <= VI_MODES && body->contacts >= 1
                && body->contacts <= VI_ORBIT_CONTACTS && body->harmonics >= 1 && body->harmonics <= VI_ORBIT_HARMONICS
                && body->angular_frequency > 0.0 && isfinite(body->angular_frequency);
    for (int k = 0; good && k < body->harmonics; ++k) {
        good = body->order[k] >= 1.0 && body->order[k] == floor(body->order[k])
               && is_finite(body->modes, body->cosine + (ptrdiff_t)k * body->modes)
               && is_finite(body->modes, body->sine + (ptrdiff_t)k * body->modes)
               && is_finite(body->contacts, body->stop_cosine + (ptrdiff_t)k * body->contacts)
               && is_finite(body->contacts, body->stop_sine + (ptrdiff_t)k * body->contacts);
    }
    for (int j = 0; good && j < body->modes; ++j) {
        good = isfinite(body->natural[j]) && isfinite(body->damping_ratio[j] + body->held[j])
               && (body->natural[j] != 0.0
                   || ((j == 0 || body->natural[j - 1] == 0.0) && body->damping_ratio[j] == 0.0));
    }
    for (int k = 0; good && k < body->contacts; ++k) {
        good = fabs(body->direction[k]) == 1.0 && isfinite(body->position[k]) && body->restitution[k] >= 0.0
               && body->restitution[k] <= 1.0 && body->yield_velocity[k] >= 0.0
               && isfinite(body->yield_velocity[k]);
    }
    return good;
}

static bool is_train(const vi_orbit_train *train, int contacts)
{
    bool good = train->impacts >= 1 && train->impacts <= VI_ORBIT_IMPACTS && train->periods >= 1;
    for (int i = 0; good && i < train->impacts; ++i) {
        good = train->contact[i] >= 0 && train->contact[i] < contacts && isfinite(train->phase[i])
               && (i == 0 || train->phase[i] > train->phase[i - 1]);
    }
    return good && train->phase[train->impacts - 1] - train->phase[0] < TURN * train->periods;
}

/* The state just after an impulse once in each train: (1 - Phi(T))^-1 (0, 1), free of cancellation at light damping. */
static bool start_of_train(const vi_mode *mode, double length, double start[2])
{
    double phi[4];
    vi_mode_propagator(mode, length, phi);
    double whole, moved; /* det(1 - Phi), 1 - Phi11 */
    if (mode->regime == VI_UNDERDAMPED) {
        const double gone = -expm1(-mode->decay * length), left = exp(-mode->decay * length);
        const double half = sin(0.5 * mode->rate * length);
        whole = gone * gone + 4.0 * left * half * half;
        moved = gone + 2.0 * left * half * half - mode->decay * phi[1];
    } else {
        whole = expm1(-mode->slow * length) * expm1(-mode->fast * length);
        moved = 1.0 - phi[0];
    }
    /* an undamped mode after whole turns: only rounding is left of 1 - Phi */
    const double rounding = 4.0 * DBL_EPSILON * (1.0 + mode->natural * length);
    if (!(fabs(whole) > rounding * rounding)) { /* negative where one of two rates grows */
        return false;
    }
    start[0] = phi[1] / whole;
    start[1] = moved / whole;
    return isfinite(start[0] + start[1]);
}

/* Does the damping couple the modes, and are the terms of their motion known? */
static bool by_terms(const vi_orbit_body *body)
{
    return body->coupling && body->coupling->terms.terms > 0;
}

/* Does the damping couple the modes, next to critical damping? */
static bool by_series(const vi_orbit_body *body)
{
    return body->coupling && body->coupling->terms.terms == 0;
}

/* Number of modes, from the first, that move each by itself: all, or those without a spring beside coupled modes. */
static int of_one_mode(const vi_orbit_response *response)
{
    return response->body->coupling ? response->loose : response->body->modes;
}

/* Find the steady response of mode j to each sine of the force; false where one is unbounded. */
static bool find_steady(vi_orbit_response *response, int j)
{
    const vi_orbit_body *body = response->body;
    const double natural = body->natural[j], decay = response->mode[j].decay;
    double sum = 0.0;
    for (int k = 0; k < body->harmonics; ++k) {
        double *along = &response->steady_cos[k][j], *across = &response->steady_sin[k][j];
        if (body->coupling && j >= response->loose) {
            *along = body->coupling->steady[k][j - response->loose].re;
            *across = -body->coupling->steady[k][j - response->loose].im;
        } else {
            const double w = body->order[k] * body->angular_frequency;
            const double c = body->cosine[k * body->modes + j], s = body->sine[k * body->modes + j];
            const double detuning = natural < 0.0 ? response->mode[j].stiffness - w * w : (natural - w) * (natural + w);
            const double drag = 2.0 * decay * w;
            const double size = vi_magnitude(detuning, drag);
            const double in_phase = detuning / size / size, lagging = drag / size / size;
            *along = c == 0.0 && s == 0.0 ? 0.0 : c * in_phase - s * lagging;
            *across = c == 0.0 && s == 0.0 ? 0.0 : c * lagging + s * in_phase;
        }
        sum += *along + *across;
    }
    return isfinite(sum);
}

int vi_orbit_modes(vi_orbit_response *response, const vi_orbit_body *body)
{
    if (!is_body(body)) {
        return VI_ORBIT_REFUSED;
    }
    if (body->coupling && body->coupling->terms.terms == 0
        && !(body->coupling->fastest < MOST_OF_SERIES * body->angular_frequency)) {
        return VI_ORBIT_CRITICAL;
    }
    response->body = body;
    response->loose = 0;
    for (int j = 0; j < body->modes; ++j) {
        response->loose += body->natural[j] == 0.0;
        vi_mode *mode = &response->mode[j];
        const double natural = body->natural[j], size = fabs(natural);
        vi_mode_start(mode, 1.0, 2.0 * body->damping_ratio[j] * size, natural * size, 0.0, body->angular_frequency);
        response->level[j] = j < response->loose ? 0.0 : body->held[j] / mode->stiffness;
        if (!find_steady(response, j)) {
            return VI_ORBIT_RESONANT;
        }
    }
    return VI_ORBIT_DONE;
}

int vi_orbit_respond(vi_orbit_response *response, const vi_orbit_body *body, const vi_orbit_train *train)
{
    const int refused = vi_orbit_modes(response, body);
    if (refused != VI_ORBIT_DONE) {
        return refused;
    }
    if (!is_train(train, body->contacts)) {
        return VI_ORBIT_REFUSED;
    }
    response->train = train;
    response->length = TURN * train->periods / body->angular_frequency;
    for (int j = 0; j < of_one_mode(response); ++j) {
        if (j < response->loose) {
            response->start[j][0] = -response->length / 12.0;
            response->start[j][1] = 0.5;
        } else if (!start_of_train(&response->mode[j], response->length, response->start[j])) {
            return VI_ORBIT_RESONANT;
        }
    }
    if (by_series(body)
        && !vi_orbit_recurring_states(body->coupling, body->contacts, body->impulse + response->loose, body->modes,
                                      response->length, response->state)) {
        return VI_ORBIT_RESONANT;
    }
    for (int k = 0; by_terms(body) && k < body->contacts; ++k) {
        const double *impulse = body->impulse + (ptrdiff_t)k * body->modes + response->loose;
        if (!vi_orbit_recurring_parts(body->coupling, impulse, response->length, response->part[k])) {
            return VI_ORBIT_RESONANT;
        }
    }
    return VI_ORBIT_DONE;
}

static void carry_coupled(const vi_orbit_response *response, double u, int columns, double change[][VI_ORBIT_STATES])
{
    const vi_orbit_coupling *coupling = response->body->coupling;
    const int modes = response->body->modes, loose = response->loose;
    vi_complex turn[VI_TERMS], part[VI_TERMS];
    if (by_terms(response->body)) {
        vi_orbit_turns(coupling, u, turn);
    }
    for (int c = 0; c < columns; ++c) {
        double x[VI_MODES], v[VI_MODES];
        for (int j = loose; j < modes; ++j) {
            x[j - loose] = change[j][c];
            v[j - loose] = change[modes + j][c];
        }
        if (by_terms(response->body)) {
            vi_pressed_parts(&coupling->terms, x, v, part);
            vi_orbit_turned_sum(coupling, part, turn, x, v);
        } else {
            vi_orbit_series(coupling, u, x, v);
        }
        for (int j = loose; j < modes; ++j) {
            change[j][c] = x[j - loose];
            change[modes + j][c] = v[j - loose];
        }
    }
}

void vi_orbit_carry(const vi_orbit_response *response, double u, int columns, double change[][VI_ORBIT_STATES])
{
    const int modes = response->body->modes;
    if (response->body->coupling) {
        carry_coupled(response, u, columns, change);
    }
    for (int j = 0; j < of_one_mode(response); ++j) {
        double phi[4];
        vi_mode_propagator(&response->mode[j], u, phi);
        for (int c = 0; c < columns; ++c) {
            const double x = change[j][c], v = change[modes + j][c];
            change[j][c] = phi[0] * x + phi[1] * v;
            change[modes + j][c] = phi[2] * x + phi[3] * v;
        }
    }
}

double vi_orbit_since(const vi_orbit_response *response, int i, int k)
{
    const double *phase = response->train->phase;
    const double passed = (phase[i] - phase[k]) / response->body->angular_frequency;
    return i > k ? passed : response->length + passed;
}

/* e^(-rate u) / (1 - e^(-rate length)) for 0 <= u <= length: a part of a motion that recurs, growing or not. */
static double recurring(double rate, double u, double length)
{
    return rate > 0.0 ? exp(-rate * u) / -expm1(-rate * length) : exp(rate * (length - u)) / expm1(rate * length);
}

/* Motion `u` seconds after a unit impulse that recurs, of a mode of negative stiffness. Each exponential is by itself:
 * a propagator would multiply the rounding of the start by the growth. */
static void recur_of_two_rates(const vi_mode *mode, double length, double u, double *x, double *v)
{
    const double slow = recurring(mode->slow, u, length), fast = recurring(mode->fast, u, length);
    *x = (slow - fast) / (2.0 * mode->rate);
    *v = (mode->fast * fast - mode->slow * slow) / (2.0 * mode->rate);
}

void vi_orbit_train_answer(const vi_orbit_response *response, int contact, double u, double x[], double v[])
{
    const vi_orbit_body *body = response->body;
    const int loose = response->loose, coupled = body->modes - loose;
    if (by_terms(body)) {
        vi_complex turn[VI_TERMS];
        vi_orbit_turns(body->coupling, u, turn);
        vi_orbit_turned_sum(body->coupling, response->part[contact], turn, x + loose, v + loose);
    } else if (by_series(body)) {
        memcpy(x + loose, response->state[contact], (size_t)coupled * sizeof x[0]);
        memcpy(v + loose, response->state[contact] + coupled, (size_t)coupled * sizeof v[0]);
        vi_orbit_series(body->coupling, u, x + loose, v + loose);
    }
    for (int j = 0; j < body->modes; ++j) {
        const double *start = response->start[j], impulse = body->impulse[(ptrdiff_t)contact * body->modes + j];
        double phi[4];
        if (j < loose) {
            x[j] = -(start[0] + u * (start[1] - 0.5 * u / response->length)) * impulse;
            v[j] = -(start[1] - u / response->length) * impulse;
        } else if (body->coupling) {
            x[j] = -x[j];
            v[j] = -v[j];
        } else if (response->mode[j].stiffness < 0.0) {
            double moved, faster;
            recur_of_two_rates(&response->mode[j], response->length, u, &moved, &faster);
            x[j] = -moved * impulse;
            v[j] = -faster * impulse;
        } else {
            vi_mode_propagator(&response->mode[j], u, phi);
            x[j] = -(phi[0] * start[0] + phi[1] * start[1]) * impulse;
            v[j] = -(phi[2] * start[0] + phi[3] * start[1]) * impulse;
        }
    }
}

double vi_orbit_evening(const vi_orbit_response *response, int contact, int j)
{
    const vi_orbit_body *body = response->body;
    return j < response->loose ? body->impulse[(ptrdiff_t)contact * body->modes + j] / response->length : 0.0;
}

void vi_orbit_drag(const vi_orbit_response *response, const double v[], double drag[])
{
    const vi_orbit_body *body = response->body;
    for (int j = 0; j < body->modes; ++j) {
        drag[j] = j < of_one_mode(response)
                      ? 2.0 * response->mode[j].decay * v[j]
                      : vi_pressed_drag(&body->coupling->body, j - response->loose, v + response->loose);
    }
}

/* Coefficient of restitution of an impact at a contact. */
static double restitution_at(const vi_orbit_body *body, int contact, double velocity)
{
    const vi_contact_law law = {.restitution = body->restitution[contact],
                                .yield_velocity = body->yield_velocity[contact]};
    return vi_contact_law_restitution(&law, velocity);
}

double vi_orbit_equal_speed(const vi_orbit_body *body, int contact, double velocity, double *slope)
{
    const double r = restitution_at(body, contact, velocity), whole = 1.0 + body->restitution[contact];
    if (r == body->restitution[contact]) {
        *slope = 1.0;
        return velocity;
    }
    *slope = (1.0 + FALLING * r) / whole;
    return (1.0 + r) / whole * velocity;
}

void vi_orbit_free(const vi_orbit_response *response, double u, double x[], double v[])
{
    const vi_orbit_body *body = response->body;
    if (by_series(body)) {
        vi_orbit_series(body->coupling, u, x + response->loose, v + response->loose);
    }
    if (by_terms(body)) {
        vi_complex turn[VI_TERMS], part[VI_TERMS];
        vi_orbit_turns(body->coupling, u, turn);
        vi_pressed_parts(&body->coupling->terms, x + response->loose, v + response->loose, part);
        vi_orbit_turned_sum(body->coupling, part, turn, x + response->loose, v + response->loose);
    }
    for (int j = 0; j < of_one_mode(response); ++j) {
        const double displacement = x[j], velocity = v[j];
        double phi[4];
        vi_mode_propagator(&response->mode[j], u, phi);
        x[j] = phi[0] * displacement + phi[1] * velocity;
        v[j] = phi[2] * displacement + phi[3] * velocity;
    }
}

void vi_orbit_steady(const vi_orbit_response *response, double phase, double x[], double v[])
{
    const vi_orbit_body *body = response->body;
    for (int j = 0; j < body->modes; ++j) {
        x[j] = response->level[j];
        v[j] = 0.0;
    }
    for (int k = 0; k < body->harmonics; ++k) {
        const double *along = response->steady_cos[k], *across = response->steady_sin[k];
        const double w = body->order[k] * body->angular_frequency, angle = body->order[k] * phase;
        const double c = cos(angle), s = sin(angle);
        for (int j = 0; j < body->modes; ++j) {
            x[j] = x[j] + along[j] * c + across[j] * s;
            v[j] += w * (across[j] * c - along[j] * s);
        }
    }
}

void vi_orbit_steady_gap(const vi_orbit_response *response, int contact, vi_orbit_gap *gap)
{
    const vi_orbit_body *body = response->body;
    const double *shape = body->shape + (ptrdiff_t)contact * body->modes;
    gap->level = 0.0;
    for (int j = 0; j < body->modes; ++j) {
        gap->level += shape[j] * response->level[j];
    }
    for (int k = 0; k < body->harmonics; ++k) {
        double cosine = 0.0, sine = 0.0;
        for (int j = 0; j < body->modes; ++j) {
            cosine += shape[j] * response->steady_cos[k][j];
            sine += shape[j] * response->steady_sin[k][j];
        }
        gap->cosine[k] = cosine - body->stop_cosine[k * body->contacts + contact];
        gap->sine[k] = sine - body->stop_sine[k * body->contacts + contact];
    }
}

void vi_orbit_stop(const vi_orbit_body *body, int contact, double phase, double at[3])
{
    at[0] = at[1] = at[2] = 0.0;
    for (int k = 0; k < body->harmonics; ++k) {
        const double w = body->order[k] * body->angular_frequency, angle = body->order[k] * phase;
        const double along = body->stop_cosine[k * body->contacts + contact];
        const double across = body->stop_sine[k * body->contacts + contact];
        const double moved = along * cos(angle) + across * sin(angle);
        at[0] += moved;
        at[1] += w * (across * cos(angle) - along * sin(angle));
        at[2] -= w * w * moved;
    }
}

void vi_orbit_steady_at(const vi_orbit_response *response, int i, double at[3])
{
    const vi_orbit_body *body = response->body;
    const int32_t contact = response->train->contact[i];
    const double *shape = body->shape + (ptrdiff_t)contact * body->modes;
    const double phase = response->train->phase[i], direction = body->direction[contact];
    double level = 0.0, stop[3];
    for (int j = 0; j < body->modes; ++j) {
        level += shape[j] * response->level[j];
    }
    at[0] = at[1] = at[2] = 0.0;
    for (int k = 0; k < body->harmonics; ++k) {
        const double *along = response->steady_cos[k], *across = response->steady_sin[k];
        const double w = body->order[k] * body->angular_frequency, angle = body->order[k] * phase;
        const double c = cos(angle), s = sin(angle);
        double x = 0.0, v = 0.0;
        for (int j = 0; j < body->modes; ++j) {
            x += shape[j] * (along[j] * c + across[j] * s);
            v += shape[j] * (w * (across[j] * c - along[j] * s));
        }
        at[0] += x;
        at[1] += direction * v;
        at[2] -= direction * w * w * x;
    }
    vi_orbit_stop(body, contact, phase, stop);
    at[0] = direction * (at[0] - stop[0] + level - body->position[contact]);
    at[1] -= direction * stop[1];
    at[2] -= direction * stop[2];
}

/* Modal force of all sines at a phase of the clock. */
static void force_at(const vi_orbit_body *body, double phase, double force[])
{
    for (int j = 0; j < body->modes; ++j) {
        force[j] = 0.0;
    }
    for (int k = 0; k < body->harmonics; ++k) {
        const double c = cos(body->order[k] * phase), s = sin(body->order[k] * phase);
        for (int j = 0; j < body->modes; ++j) {
            force[j] = force[j] + body->cosine[k * body->modes + j] * c + body->sine[k * body->modes + j] * s;
        }
    }
}

void vi_orbit_salt(const vi_orbit_response *response, int contact, double phase, double velocity, const double state[],
                   int columns, double change[][VI_ORBIT_STATES])
{
    const vi_orbit_body *body = response->body;
    const int modes = body->modes;
    const double *shape = body->shape + (ptrdiff_t)contact * modes;
    const double *impulse = body->impulse + (ptrdiff_t)contact * modes;
    const double lost = 1.0 + restitution_at(body, contact, velocity), speed = body->direction[contact] * velocity;
    double share; /* derivative of the loss over the speed, over the loss per speed */
    (void)vi_orbit_equal_speed(body, contact, velocity, &share);
    share *= (1.0 + body->restitution[contact]) / lost;
    double before[VI_MODES] = {0.0}, force[VI_MODES], drag[VI_MODES], lost_drag[VI_MODES], stop[3];
    vi_orbit_stop(body, contact, phase, stop);
    double acceleration = -stop[2]; /* of the contact relative to its stop, before the impact */
    for (int j = 0; j < modes; ++j) {
        before[j] = state[modes + j] + lost * speed * impulse[j];
    }
    vi_orbit_drag(response, before, drag);
    vi_orbit_drag(response, impulse, lost_drag);
    force_at(body, phase, force);
    for (int j = 0; j < modes; ++j) {
        acceleration += shape[j] * (force[j] + body->held[j] - drag[j] - response->mode[j].stiffness * state[j]);
    }
    for (int c = 0; c < columns; ++c) {
        double displaced = 0.0, faster = 0.0;
        for (int j = 0; j < modes; ++j) {
            displaced += shape[j] * change[j][c];
            faster += shape[j] * change[modes + j][c];
        }
        const double later = displaced / speed;
        for (int j = 0; j < modes; ++j) {
            const double held_back = speed * lost_drag[j] + share * acceleration * impulse[j];
            change[j][c] -= lost * impulse[j] * displaced;
            change[modes + j][c] += lost * (held_back * later - share * impulse[j] * faster);
        }
    }
}
