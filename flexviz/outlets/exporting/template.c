/* Inverse dynamics of elastic joints: the template of the exported C code.
 *
 * The robot's numbers replace "code:"; NAME becomes the robot's name, and sections between [name and name]
 * are left out if the robot has no such effect.
 */
#include "NAME_dynamics.h"

#include <math.h>
#include <stddef.h>

enum { N = NAME_JOINTS };

/* code: */

/* A quantity with its first and second time derivative. */
typedef struct {
    double d[3];
} jet;

static jet constant(double value)
{
    jet out = {{value, 0.0, 0.0}};
    return out;
}

static jet add(jet a, jet b)
{
    int k;
    for (k = 0; k < 3; ++k) a.d[k] += b.d[k];
    return a;
}

static jet scaled(double factor, jet a)
{
    int k;
    for (k = 0; k < 3; ++k) a.d[k] *= factor;
    return a;
}

static jet product(jet a, jet b)
{
    jet out;
    out.d[0] = a.d[0] * b.d[0];
    out.d[1] = a.d[1] * b.d[0] + a.d[0] * b.d[1];
    out.d[2] = a.d[2] * b.d[0] + 2.0 * a.d[1] * b.d[1] + a.d[0] * b.d[2];
    return out;
}

/* out += a x b */
static void add_cross(jet out[3], const jet a[3], const jet b[3])
{
    int i;
    for (i = 0; i < 3; ++i) {
        const int j = (i + 1) % 3, k = (i + 2) % 3;
        out[i] = add(out[i], add(product(a[j], b[k]), scaled(-1.0, product(a[k], b[j]))));
    }
}

/* out += factor * axis, with a constant axis */
static void add_along(jet out[3], const double axis[3], jet factor)
{
    int i;
    for (i = 0; i < 3; ++i) out[i] = add(out[i], scaled(axis[i], factor));
}

/* out += matrix * v, with a constant matrix */
static void add_matrix(jet out[3], const double matrix[3][3], const jet v[3])
{
    int i, j;
    for (i = 0; i < 3; ++i)
        for (j = 0; j < 3; ++j) out[i] = add(out[i], scaled(matrix[i][j], v[j]));
}

/* out = rotation^T * v: from the parent's axes into the body's own */
static void into(jet out[3], const jet rotation[3][3], const jet v[3])
{
    int i, j;
    for (i = 0; i < 3; ++i) {
        out[i] = constant(0.0);
        for (j = 0; j < 3; ++j) out[i] = add(out[i], product(rotation[j][i], v[j]));
    }
}

/* out = rotation * v: from the body's axes into its parent's */
static void out_of(jet out[3], const jet rotation[3][3], const jet v[3])
{
    int i, j;
    for (i = 0; i < 3; ++i) {
        out[i] = constant(0.0);
        for (j = 0; j < 3; ++j) out[i] = add(out[i], product(rotation[i][j], v[j]));
    }
}

static void set_zero(jet v[3])
{
    int i;
    for (i = 0; i < 3; ++i) v[i] = constant(0.0);
}

static void sum(jet out[3], const jet a[3], const jet b[3])
{
    int i;
    for (i = 0; i < 3; ++i) out[i] = add(a[i], b[i]);
}

/* Pose of body b in its parent: axes and origin. */
static void pose(int b, jet q, jet rotation[3][3], jet place[3])
{
    const double s = sin(q.d[0]), c = cos(q.d[0]), q1 = q.d[1], q2 = q.d[2];
    const jet sine = {{s, c * q1, c * q2 - s * q1 * q1}};
    const jet cosine = {{c, -s * q1, -s * q2 - c * q1 * q1}};
    int i, j;
    for (i = 0; i < 3; ++i) {
        for (j = 0; j < 3; ++j)
            rotation[i][j] = add(constant(STILL[b][i][j]),
                                 add(scaled(SINE[b][i][j], sine), scaled(COSINE[b][i][j], cosine)));
        place[i] = add(constant(PLACE[b][i]), scaled(SLIDE[b][i], q));
    }
}

/* [compensator */
/* Torque of joint i's gravity compensator. */
static jet compensator(int i, jet q)
{
    const double s = sin(q.d[0]), c = cos(q.d[0]);
    jet out = constant(0.0);
    size_t k;
    for (k = 0; k < sizeof COMPENSATOR / sizeof COMPENSATOR[0]; ++k)
        if (COMPENSATOR[k].joint == i) {
            const double torque = COMPENSATOR[k].sine * s + COMPENSATOR[k].cosine * c;
            const double slope = COMPENSATOR[k].sine * c - COMPENSATOR[k].cosine * s;
            const jet part = {{torque, slope * q.d[1], slope * q.d[2] - torque * q.d[1] * q.d[1]}};
            out = add(out, part);
        }
    return out;
}

/* compensator] */
/* Torque on the links by recursive Newton-Euler, each body in its own frame; gravity is an acceleration
 * of the base. w, u: angular and linear velocity; dw, du: their rates; force, moment: on the body. */
static void links(const jet q[N], const jet v[N], const jet a[N], jet torque[N])
{
    jet rotation[N][3][3], place[N][3];
    jet w[N][3], u[N][3], dw[N][3], du[N][3], force[N][3], moment[N][3];
    int b, i, k;
    for (b = 0; b < N; ++b) {
        jet base[3], base_lift[3], point[3], turn[3], push[3], mass_moment[3], linear[3], angular[3];
        const jet *w0 = base, *u0 = base, *dw0 = base, *du0 = base_lift;
        const int joint = JOINT[b], parent = PARENT[b];
        set_zero(base);
        for (k = 0; k < 3; ++k) base_lift[k] = constant(-GRAVITY[k]);
        if (parent >= 0) {
            w0 = w[parent];
            u0 = u[parent];
            dw0 = dw[parent];
            du0 = du[parent];
        }
        pose(b, q[joint], rotation[b], place[b]);
        set_zero(turn);
        add_along(turn, TURN[b], v[joint]);
        set_zero(push);
        add_along(push, PUSH[b], v[joint]);

        sum(point, u0, base);
        add_cross(point, w0, place[b]);
        into(u[b], (const jet(*)[3])rotation[b], point);
        sum(u[b], u[b], push);
        sum(point, du0, base);
        add_cross(point, dw0, place[b]);
        into(du[b], (const jet(*)[3])rotation[b], point);
        add_along(du[b], PUSH[b], a[joint]);
        into(w[b], (const jet(*)[3])rotation[b], w0);
        sum(w[b], w[b], turn);
        into(dw[b], (const jet(*)[3])rotation[b], dw0);
        add_along(dw[b], TURN[b], a[joint]);
        add_cross(dw[b], w[b], turn);
        add_cross(du[b], w[b], push);
        add_cross(du[b], u[b], turn);

        for (k = 0; k < 3; ++k) {
            mass_moment[k] = constant(MOMENT[b][k]);
            linear[k] = scaled(MASS[b], u[b][k]);
            force[b][k] = scaled(MASS[b], du[b][k]);
        }
        add_cross(linear, w[b], mass_moment);
        set_zero(angular);
        add_matrix(angular, INERTIA[b], w[b]);
        add_cross(angular, mass_moment, u[b]);
        add_cross(force[b], dw[b], mass_moment);
        add_cross(force[b], w[b], linear);
        set_zero(moment[b]);
        add_matrix(moment[b], INERTIA[b], dw[b]);
        add_cross(moment[b], mass_moment, du[b]);
        add_cross(moment[b], w[b], angular);
        add_cross(moment[b], u[b], linear);
    }
    for (b = N - 1; b >= 0; --b) {
        const int joint = JOINT[b], parent = PARENT[b];
        jet carried[3];
        torque[joint] = constant(0.0);
        for (k = 0; k < 3; ++k)
            torque[joint] = add(torque[joint], add(scaled(PUSH[b][k], force[b][k]),
                                                   scaled(TURN[b][k], moment[b][k])));
        if (parent < 0) continue;
        out_of(carried, (const jet(*)[3])rotation[b], force[b]);
        sum(force[parent], force[parent], carried);
        add_cross(moment[parent], place[b], carried);
        out_of(carried, (const jet(*)[3])rotation[b], moment[b]);
        sum(moment[parent], moment[parent], carried);
    }
    for (i = 0; i < N; ++i) {
        torque[i] = add(torque[i], scaled(LINK_VISCOUS[i], v[i]));
        /* [spring */
        torque[i] = add(torque[i], add(scaled(SPRING[i], q[i]), constant(-SPRING_TORQUE[i])));
        /* spring] */
        /* [compensator */
        torque[i] = add(torque[i], compensator(i, q[i]));
        /* compensator] */
        /* [link_coulomb */
        /* dry friction jumps where a link reverses: the jump has no derivatives that a motor could follow */
        torque[i].d[0] += LINK_COULOMB[i] * tanh(v[i].d[0] / SIGN_VELOCITY);
        /* link_coulomb] */
    }
}

/* Deflection of joint i's spring under a torque. */
static jet spring(int i, jet load)
{
    /* [cubic */
    if (CUBIC[i] > 0.0) {
        const double scale = sqrt(4.0 * STIFFNESS[i] / (3.0 * CUBIC[i]));
        const double x = scale * sinh(asinh(3.0 * load.d[0] / (STIFFNESS[i] * scale)) / 3.0);
        const double tangent = STIFFNESS[i] + 3.0 * CUBIC[i] * x * x;
        jet out;
        out.d[0] = x;
        out.d[1] = load.d[1] / tangent;
        out.d[2] = (load.d[2] - 6.0 * CUBIC[i] * x * out.d[1] * out.d[1]) / tangent;
        return out;
    }
    /* cubic] */
    return scaled(1.0 / STIFFNESS[i], load);
}

/* Deflection of joint i under a torque. */
static jet deflection(int i, jet load)
{
    jet x = spring(i, load);
    /* [damping */
    /* K x + D dx/dt = load: the series in D/K as far as the given derivatives reach */
    int k;
    for (k = 0; k < 3; ++k) {
        const jet rate = {{x.d[1], x.d[2], 0.0}};
        x = spring(i, add(load, scaled(-DAMPING[i], rate)));
    }
    /* damping] */
    return x;
}

/* [error */
/* Joint i's angle behind the gear's error, with slope and curvature over the motor's angle. */
static void with_error(int i, double theta, double out[3])
{
    size_t k;
    out[0] = theta;
    out[1] = 1.0;
    out[2] = 0.0;
    for (k = 0; k < sizeof ERROR / sizeof ERROR[0]; ++k) {
        const double order = ERROR[k].order, angle = order * theta + ERROR[k].phase;
        if (ERROR[k].joint != i) continue;
        out[0] += ERROR[k].amplitude * sin(angle);
        out[1] += ERROR[k].amplitude * order * cos(angle);
        out[2] -= ERROR[k].amplitude * order * order * sin(angle);
    }
}

/* The motor's motion whose gear, with its error, gives joint i's motion `link`. */
static jet before_error(int i, jet link)
{
    double at[3];
    jet theta = link;
    int k;
    for (k = 0; k < 50; ++k) {
        double step;
        with_error(i, theta.d[0], at);
        step = (at[0] - link.d[0]) / at[1];
        theta.d[0] -= step;
        if (fabs(step) <= 1e-15 * (1.0 + fabs(theta.d[0]))) break;
    }
    with_error(i, theta.d[0], at);
    theta.d[1] = link.d[1] / at[1];
    theta.d[2] = (link.d[2] - at[2] * theta.d[1] * theta.d[1]) / at[1];
    return theta;
}

/* error] */
/* [presliding */
/* Presliding friction k as a share of its sliding friction, by Dahl's law. */
static double presliding(size_t k, double theta, double sign, NAME_memory *memory)
{
    const int i = PRESLIDING[k].joint;
    double path, side;
    if (memory == NULL) return sign;
    path = memory->started ? theta - memory->theta[i] : 0.0;
    side = (double)((path > 0.0) - (path < 0.0));
    if (path != 0.0)
        memory->share[i] = side + (memory->share[i] - side)
            * exp(-PRESLIDING[k].stiffness / PRESLIDING[k].coulomb * fabs(path));
    memory->theta[i] = theta;
    return memory->share[i];
}

/* presliding] */
/* Motor torque for the motion theta of the motors under the joint torque. */
static void motors(const jet theta[N], const jet load[N], double time, NAME_memory *memory, double tau[N])
{
    int i;
    /* [lists */
    size_t k;
    /* lists] */
    for (i = 0; i < N; ++i) {
        const double speed = theta[i].d[1];
        /* [sign */
        const double sign = tanh(speed / SIGN_VELOCITY);
        /* sign] */
        tau[i] = load[i].d[0] + MOTOR_INERTIA[i] * theta[i].d[2] + MOTOR_VISCOUS[i] * speed;
        /* [motor_coulomb */
        tau[i] += MOTOR_COULOMB[i] * sign;
        /* motor_coulomb] */
        /* [quadratic */
        tau[i] += QUADRATIC[i] * speed * fabs(speed);
        /* quadratic] */
        /* [directional */
        tau[i] += DIRECTIONAL[i] * fabs(speed);
        /* directional] */
        /* [thinning */
        for (k = 0; k < sizeof THINNING / sizeof THINNING[0]; ++k)
            if (THINNING[k].joint == i) tau[i] += THINNING[k].thinning * asinh(speed / THINNING[k].width);
        /* thinning] */
        /* [load */
        tau[i] += LOAD[i] * fabs(load[i].d[0]) * sign;
        /* load] */
        /* [driving */
        for (k = 0; k < sizeof DRIVING / sizeof DRIVING[0]; ++k)
            if (DRIVING[k].joint == i)
                tau[i] += (load[i].d[0] * speed > 0.0 ? DRIVING[k].motor : DRIVING[k].load)
                    * fabs(load[i].d[0]) * sign;
        /* driving] */
        /* [offset */
        tau[i] += OFFSET[i];
        /* offset] */
        /* [stribeck */
        for (k = 0; k < sizeof STRIBECK / sizeof STRIBECK[0]; ++k) {
            const double ratio = speed / STRIBECK[k].width;
            if (STRIBECK[k].joint == i) tau[i] += STRIBECK[k].stribeck * exp(-ratio * ratio) * sign;
        }
        /* stribeck] */
        /* [ripple */
        for (k = 0; k < sizeof RIPPLE / sizeof RIPPLE[0]; ++k)
            if (RIPPLE[k].joint == i)
                tau[i] += RIPPLE[k].amplitude * sin(RIPPLE[k].order * theta[i].d[0] + RIPPLE[k].phase);
        /* ripple] */
        /* [drift */
        for (k = 0; k < sizeof DRIFT / sizeof DRIFT[0]; ++k)
            if (DRIFT[k].joint == i)
                tau[i] += MOTOR_VISCOUS[i] * speed * DRIFT[k].rise * exp(-time / DRIFT[k].constant);
        /* drift] */
        /* [coupling */
        for (k = 0; k < sizeof COUPLING / sizeof COUPLING[0]; ++k)
            if (COUPLING[k].joint == i) tau[i] += COUPLING[k].inertia * theta[COUPLING[k].other].d[2];
        /* coupling] */
        /* [coupled */
        for (k = 0; k < sizeof COUPLED / sizeof COUPLED[0]; ++k)
            if (COUPLED[k].joint == i || COUPLED[k].other == i) {
                const double both = theta[COUPLED[k].joint].d[1] + theta[COUPLED[k].other].d[1];
                tau[i] += COUPLED[k].coulomb * tanh(both / SIGN_VELOCITY) + COUPLED[k].viscous * both;
            }
        /* coupled] */
        /* [presliding */
        for (k = 0; k < sizeof PRESLIDING / sizeof PRESLIDING[0]; ++k)
            if (PRESLIDING[k].joint == i)
                tau[i] += PRESLIDING[k].coulomb * presliding(k, theta[i].d[0], sign, memory);
        /* presliding] */
        /* [gain_error */
        tau[i] /= 1.0 + GAIN_ERROR[i];
        /* gain_error] */
    }
    /* [presliding */
    if (memory != NULL) memory->started = 1;
    /* presliding] */
    (void)time;
    (void)memory;
}

void NAME_reset(NAME_memory *memory)
{
    int i;
    memory->started = 0;
    for (i = 0; i < N; ++i) memory->theta[i] = memory->share[i] = 0.0;
}

void NAME_inverse_dynamics(const double q[N], const double dq[N], const double ddq[N], const double d3q[N],
                           const double d4q[N], double time, NAME_memory *memory, NAME_feed_forward *out)
{
    jet p[N], v[N], a[N], load[N], theta[N];
    int i;
    for (i = 0; i < N; ++i) {
        p[i].d[0] = q[i];
        p[i].d[1] = v[i].d[0] = dq[i];
        p[i].d[2] = v[i].d[1] = a[i].d[0] = ddq[i];
        v[i].d[2] = a[i].d[1] = d3q[i];
        a[i].d[2] = d4q[i];
    }
    links(p, v, a, load);
    for (i = 0; i < N; ++i) {
        theta[i] = add(p[i], deflection(i, load[i]));
        /* [half_width */
        /* the play jumps where the load changes sides; the jump is left to the controller */
        theta[i].d[0] += HALF_WIDTH[i] * (double)((load[i].d[0] > 0.0) - (load[i].d[0] < 0.0));
        /* half_width] */
        /* [error */
        theta[i] = before_error(i, theta[i]);
        /* error] */
        out->theta[i] = theta[i].d[0];
        out->theta_velocity[i] = theta[i].d[1];
        out->tau_joint[i] = load[i].d[0];
    }
    motors(theta, load, time, memory, out->tau);
}

/* Torque on the links without its derivatives. */
static void still_links(const double q[N], const double dq[N], const double ddq[N], jet load[N])
{
    jet p[N], v[N], a[N];
    int i;
    for (i = 0; i < N; ++i) {
        p[i] = constant(q[i]);
        v[i] = constant(dq[i]);
        a[i] = constant(ddq[i]);
    }
    links(p, v, a, load);
}

void NAME_rigid_inverse_dynamics(const double q[N], const double dq[N], const double ddq[N], double time,
                                 NAME_memory *memory, double tau[N])
{
    jet theta[N], load[N];
    int i;
    still_links(q, dq, ddq, load);
    for (i = 0; i < N; ++i) {
        theta[i].d[0] = q[i];
        theta[i].d[1] = dq[i];
        theta[i].d[2] = ddq[i];
    }
    motors(theta, load, time, memory, tau);
}

void NAME_link_torque(const double q[N], const double dq[N], const double ddq[N], double tau_joint[N])
{
    jet load[N];
    int i;
    still_links(q, dq, ddq, load);
    for (i = 0; i < N; ++i) tau_joint[i] = load[i].d[0];
}
