/* A body integrated by its importer with plain Euler steps: impacts, chatter to rest and release, stops that yield. */
#include "body/modal/structure/exchange.h"
#include "body/modal/structure/structure.h"

#include <math.h>
#include <string.h>

#include "check.h"

static vi_structure_model model;
static vi_structure_state state;
static vi_contact contacts[VI_PORTS];
static vi_record record;

static vi_exchange_body body_of(void)
{
    return (vi_exchange_body){.parts = {&model, &state, contacts, &record}, .modes = 1, .contacts = 2, .scale = 1.0};
}

/* One mode of rate 1 with a stop at `position`, from `displacement`, pressed by a constant load. */
static vi_exchange_body begin(vi_contact_law law, double position, double displacement, double load)
{
    memset(&model, 0, sizeof model);
    memset(&state, 0, sizeof state);
    memset(contacts, 0, sizeof contacts);
    memset(&record, 0, sizeof record);
    vi_exchange_body body = body_of();
    vi_exchange_enable(&body);
    model.modes = 1;
    model.contacts = 2;
    model.tolerance = 1e-10;
    vi_structure_mode(&model, 0, 1.0, 0.0, 0.0, 0.0);
    for (int k = 0; k < 2; ++k) {
        model.shape[k][0] = model.impulse[k][0] = 1.0;
        contacts[k].side = k == 0 ? VI_SIDE_UPPER : VI_SIDE_LOWER;
    }
    contacts[0].law = law;
    contacts[0].position = position;
    vi_instant now;
    CHECK(vi_clock_start(&model.clock, 0.0, 0.0, 1.0) && vi_clock_instant(&model.clock, 0.0, 0.0, &now), "%d", 0);
    vi_structure_prepare(&model);
    state.q[0] = displacement;
    vi_structure_start(&body.parts, now);
    const double held[VI_MODES] = {load}, rate[VI_MODES] = {1.0};
    vi_structure_hold(&body.parts, held, rate);
    char message[VI_MESSAGE_LENGTH] = "";
    CHECK(vi_exchange_begin(&body, message), "%s", message);
    return body;
}

static void handle(const vi_exchange_body *body)
{
    char message[VI_MESSAGE_LENGTH] = "";
    bool changed, limit;
    CHECK(vi_exchange_event(body, &changed, &limit, message), "%s", message);
    vi_exchange_go_on(body);
}

/* Integrate by the symplectic Euler rule, with an event after each step at which an indicator is not positive. */
static void integrate(const vi_exchange_body *body, double from, double to, int steps)
{
    const double step = (to - from) / steps;
    double x[2], rate[2], sign[2];
    for (int n = 1; n <= steps; ++n) {
        vi_exchange_get_states(body, x);
        vi_exchange_get_derivatives(body, rate);
        x[1] += step * rate[1];
        x[0] += step * x[1];
        CHECK(vi_exchange_set_time(body, from + step * n), "step %d", n);
        vi_exchange_set_states(body, x);
        vi_exchange_get_indicators(body, sign);
        CHECK(isfinite(sign[0]) && sign[1] > 0.0, "indicators %g %g", sign[0], sign[1]);
        if (sign[0] <= 0.0) {
            handle(body);
        }
    }
}

int main(void)
{
    const vi_contact_law rigid = vi_contact_law_rigid(0.8);
    vi_exchange_body body = begin(rigid, 0.5, -1.0, 0.0);
    CHECK(state.held_rate[0] == 0.0, "slopes of inputs are not looked at: %g", state.held_rate[0]);
    handle(&body);
    integrate(&body, 0.0, 3.0, 30000);
    CHECK(contacts[0].count == 1, "%ld impacts", (long)contacts[0].count);
    CHECK(fabs(contacts[0].last_time - 2.0943951) < 1e-3, "impact at %.9g", contacts[0].last_time);
    CHECK(fabs(contacts[0].last_velocity - 0.8660254) < 1e-3, "with %.9g", contacts[0].last_velocity);

    /* a plastic stop holds the pressed body until the load reverses */
    const vi_contact_law plastic = vi_contact_law_rigid(0.0);
    body = begin(plastic, 0.0, -0.1, 1.0);
    handle(&body);
    integrate(&body, 0.0, 1.0, 10000);
    CHECK(contacts[0].stuck && state.q[0] == 0.0 && state.p[0] == 0.0, "x %g v %g", state.q[0], state.p[0]);
    const double away[VI_MODES] = {-1.0}, still[VI_MODES] = {0.0};
    vi_structure_hold(&body.parts, away, still);
    handle(&body);
    integrate(&body, 1.0, 1.5, 5000);
    CHECK(!contacts[0].stuck && state.q[0] < -0.1, "x %g", state.q[0]);

    /* each law that yields returns less energy than it took */
    const vi_contact_law yielding[] = {
        {.law = vi_contact_law_number("kelvin_voigt"), .stiffness = 1e3, .damping = 5.0},
        {.law = vi_contact_law_number("hertz"), .stiffness = 1e4},
        {.law = vi_contact_law_number("hunt_crossley"), .stiffness = 1e4, .damping = 0.5, .exponent = 1.5},
    };
    for (int law = 0; law < 3; ++law) {
        body = begin(yielding[law], 0.0, -1.0, 0.0);
        handle(&body);
        integrate(&body, 0.0, 3.0, 60000);
        const double energy = 0.5 * (state.q[0] * state.q[0] + state.p[0] * state.p[0]);
        CHECK(contacts[0].count == 1 && state.status[0] == VI_CONTACT_FREE, "law %d: %ld contacts", law,
              (long)contacts[0].count);
        CHECK(energy < 0.5 + 1e-3 && energy > 0.1, "law %d: energy %g", law, energy);
    }

    /* set-ups that no integrator can follow */
    const vi_contact_law external = vi_contact_law_asking();
    body = begin(rigid, 0.5, -1.0, 0.0);
    contacts[0].law = external;
    char message[VI_MESSAGE_LENGTH] = "";
    CHECK(!vi_exchange_begin(&body, message) && strstr(message, "co-simulation") != NULL, "%s", message);
    CHECK(!vi_exchange_set_time(&body, NAN), "%d", 0);
    return 0;
}
