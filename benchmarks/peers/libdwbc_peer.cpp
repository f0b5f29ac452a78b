// libdwbc's whole-body control on the states of a run, asked for ticks over a pipe.
//
//     libdwbc_peer full|reduced robot.urdf run.txt
//
// Answers on stdout, one JSON object a line, as worker.py does; what libdwbc prints goes to stderr.
// `full`: the hierarchy on the whole dynamics (ConfigureLQP). `reduced`: on the reduced dynamics,
// then the chains without contact (ConfigureLQP_R, ConfigureLQP_R_NC), whose task can be one pose
// only: the last of the run's, below the tasks of the first level.
//
// Every tick has programs of its own. libdwbc can update those of the last tick instead, but where
// the zeros of a matrix change, osqp-eigen takes the other matrices from the tick that made it.
#include <cmath>
#include <cstdio>
#include <ctime>
#include <fstream>
#include <iostream>
#include <map>
#include <memory>
#include <sstream>
#include <stdexcept>
#include <string>
#include <unistd.h>
#include <vector>

#include <dwbc.h>

namespace
{

constexpr double kGravity = 9.81;  // libdwbc's own [m/s^2]

// Weight of the joint accelerations in every level but the first, relative to the base's inertia:
// what the authors' code had before it could be chosen.
constexpr double kAccelerationCost = 5.0;

double seconds(clockid_t clock)
{
    timespec now;
    clock_gettime(clock, &now);
    return now.tv_sec + 1e-9 * now.tv_nsec;
}

struct Contact
{
    std::string link;
    Vector3d point;
    double half_length, half_width, friction;
};

struct Task
{
    std::string kind, link;  // "com", "orientation" or "pose"
    int level = 0;
    double kp = 0.0, kd = 0.0;
    Vector3d point = Vector3d::Zero();
    Matrix3d rotation = Matrix3d::Identity();  // wanted, of the link in the world
    bool moves() const { return kind != "orientation"; }
    int size() const { return kind == "pose" ? 6 : 3; }
};

struct Tick
{
    VectorXd q, v;  // as Pinocchio has them: quaternion x y z w, base velocity in the base
    std::vector<Vector3d> aims = {};  // of each task that moves: position, velocity, acceleration
};

struct Run
{
    std::vector<std::string> links;  // moved by the joints, in the order of q
    double torque_max = 0.0, acceleration_max = 0.0;
    std::vector<Contact> contacts;
    std::vector<Task> tasks;
    std::vector<Tick> ticks;
};

VectorXd take(std::istream &words, int count)
{
    VectorXd numbers(count);
    for (int i = 0; i < count; i++)
        words >> numbers[i];
    return numbers;
}

Task read_task(const std::string &kind, const std::string &link, std::istream &words)
{
    Task task;
    task.kind = kind;
    task.link = link;
    words >> task.level >> task.kp >> task.kd;
    if (kind == "com")
        return task;
    task.point = take(words, 3);
    const VectorXd rows = take(words, 9);
    task.rotation = Eigen::Map<const Eigen::Matrix<double, 3, 3, Eigen::RowMajor>>(rows.data());
    return task;
}

Run read_run(const char *path)
{
    std::ifstream file(path);
    Run run;
    std::string line, key, name;
    while (std::getline(file, line))
    {
        std::istringstream words(line);
        words >> key >> name;
        if (key == "joint")
            run.links.push_back(name);
        else if (key == "limits")
            words >> run.torque_max >> run.acceleration_max;
        else if (key == "contact")
        {
            const VectorXd n = take(words, 6);
            run.contacts.push_back({name, n.head(3), n[3], n[4], n[5]});
        }
        else if (key == "tick")
        {
            const int joints = run.links.size();
            Tick tick{take(words, 7 + joints), take(words, 6 + joints)};
            for (const Task &task : run.tasks)
                for (int i = 0; task.moves() && i < 3; i++)
                    tick.aims.push_back(take(words, 3));
            run.ticks.push_back(tick);
        }
        else if (key != "end")
            run.tasks.push_back(read_task(key, name, words));
        if (!words)
            throw std::runtime_error("a line of the run is too short: " + line.substr(0, 40));
    }
    if (key != "end")
        throw std::runtime_error("the run ends too early");
    return run;
}

Vector3d rotation_vector(const Matrix3d &rotation)
{
    const Eigen::AngleAxisd turn(rotation);
    return turn.angle() * turn.axis();
}

// A run's tasks and contacts in libdwbc, and what both ways of solving share.
class Peer
{
public:
    Peer(const std::string &urdf, const Run &run, std::vector<Task> tasks)
        : run_(run), tasks_(tasks)
    {
        robot_.LoadModelData(urdf, true, 0);
        order_ = joint_order();
        place(0);
        for (const Contact &contact : run.contacts)
        {
            link_index(contact.link);
            robot_.AddContactConstraint(contact.link.c_str(), DWBC::CONTACT_6D, contact.point,
                                        Vector3d(0, 0, 1), contact.half_length, contact.half_width);
            const double corner = std::hypot(contact.half_length, contact.half_width);
            robot_.cc_.back().SetFrictionRatio(contact.friction, 0.5 * contact.friction * corner);
        }
        std::map<int, int> levels;
        for (Task &task : tasks_)
        {
            task.level = levels.emplace(task.level, int(levels.size())).first->second;
            link_index(task.link);
            robot_.AddTaskSpace(task.level, mode(task), task.link.c_str(), task.point);
        }
        touch();
    }
    virtual ~Peer() = default;

    // Forgets the programs of the last tick.
    virtual void forget() = 0;

    // Everything from the state to the torques; times of dynamics, assembly, solve and command.
    VectorXd tick(int index, double phases[4])
    {
        const double begin = seconds(CLOCK_MONOTONIC);
        place(index);
        touch();
        aim(run_.ticks[index]);
        reduce();
        const double placed = seconds(CLOCK_MONOTONIC);
        solve();
        const double solved = seconds(CLOCK_MONOTONIC);
        const VectorXd torques = command();
        phases[0] = placed - begin;
        phases[1] = assembly_;
        phases[2] = solved - placed - assembly_;
        phases[3] = seconds(CLOCK_MONOTONIC) - solved;
        return torques;
    }

    // Residual of the base's equation of motion, relative to its nonlinear effects.
    double residual() const
    {
        const VectorXd effects = robot_.B_.head(6);
        const VectorXd base = robot_.A_.topRows(6) * accelerations() + effects
                              + robot_.J_C.leftCols(6).transpose() * forces();
        return base.norm() / std::max(1.0, effects.norm());
    }

    // Largest error of a task's acceleration [m/s^2, rad/s^2].
    double task_error() const
    {
        double worst = 0.0;
        for (const DWBC::TaskSpace &level : robot_.ts_)
        {
            const VectorXd error = level.J_task_ * accelerations() - level.f_star_;
            worst = std::max(worst, error.cwiseAbs().maxCoeff());
        }
        return worst;
    }

    // Joint torques in the order of the run.
    VectorXd ordered(const VectorXd &torques) const
    {
        VectorXd own(torques.size());
        for (int i = 0; i < own.size(); i++)
            own[i] = torques[order_[i]];
        return own;
    }

    virtual std::string name() const = 0;
    virtual int variables() const = 0;
    virtual bool solved() const = 0;
    virtual VectorXd accelerations() const = 0;
    virtual VectorXd forces() const = 0;

protected:
    virtual void reduce() {}
    virtual void solve() = 0;
    virtual VectorXd command() const = 0;

    void renew(DWBC::HQP &program) const
    {
        // Nobody else frees them.
        for (DWBC::HQP_Hierarch &level : program.hqp_hs_)
            delete level.osqp_solver_;
        program.hqp_hs_.clear();
        program.tlim_def = run_.torque_max;
        program.alim_def = run_.acceleration_max;
        program.jacc_cost = kAccelerationCost;
    }

    static bool solved_from(const DWBC::HQP &program, size_t first)
    {
        for (size_t i = first; i < program.hqp_hs_.size(); i++)
            if (program.hqp_hs_[i].osqp_solver_->getStatus() != OsqpEigen::Status::Solved)
                return false;
        return true;
    }

    DWBC::RobotData robot_;
    double assembly_ = 0.0;

private:
    static int mode(const Task &task)
    {
        if (task.kind == "com")
            return DWBC::TASK_LINK_POSITION;
        return task.kind == "pose" ? DWBC::TASK_LINK_6D_CUSTOM_FRAME : DWBC::TASK_LINK_ROTATION;
    }

    int link_index(const std::string &name) const
    {
        for (size_t i = 0; i < robot_.link_.size(); i++)
            if (robot_.link_[i].name_ == name)
                return i;
        throw std::runtime_error("libdwbc has no link " + name + ": it moves no mass");
    }

    // Where libdwbc has the joints of the run.
    std::vector<int> joint_order() const
    {
        std::vector<int> order;
        for (const std::string &link : run_.links)
            order.push_back(robot_.joint_[link_index(link)].joint_id_ - 6);
        return order;
    }

    void place(int index)
    {
        const Tick &tick = run_.ticks[index];
        const int joints = run_.links.size();
        const Eigen::Quaterniond turn(Eigen::Vector4d(tick.q.segment(3, 4)));
        VectorXd q(joints + 7), v(joints + 6);
        q << tick.q.head(6), VectorXd::Zero(joints), tick.q[6];
        v << turn * Vector3d(tick.v.head(3)), tick.v.segment(3, 3), VectorXd::Zero(joints);
        for (int i = 0; i < joints; i++)
        {
            q[6 + order_[i]] = tick.q[7 + i];
            v[6 + order_[i]] = tick.v[6 + i];
        }
        robot_.UpdateKinematics(q, v, VectorXd::Zero(joints + 6));
    }

    void touch()
    {
        if (run_.contacts.size() == 1)
            robot_.SetContact(true);
        else
            robot_.SetContact(true, true);
    }

    // Accelerations that the tasks want, without what the velocities alone bring about.
    void aim(const Tick &tick)
    {
        std::vector<VectorXd> wanted(robot_.ts_.size());
        for (size_t i = 0; i < wanted.size(); i++)
            wanted[i].setZero(robot_.ts_[i].task_dof_);
        std::vector<int> filled(wanted.size(), 0);
        auto aim = tick.aims.begin();
        for (const Task &task : run_.tasks)
        {
            const auto own = aim;
            aim += task.moves() ? 3 : 0;
            for (const Task &kept : tasks_)
                if (kept.link == task.link && kept.kind == task.kind)
                {
                    wanted[kept.level].segment(filled[kept.level], kept.size()) = want(kept, own);
                    filled[kept.level] += kept.size();
                }
        }
        for (size_t i = 0; i < wanted.size(); i++)
            robot_.SetTaskSpace(i, wanted[i]);
        robot_.UpdateTaskSpace();
    }

    VectorXd want(const Task &task, std::vector<Vector3d>::const_iterator aim)
    {
        const Vector3d lift(0, 0, kGravity);
        VectorXd wanted(task.size());
        if (task.kind == "com")
        {
            const DWBC::Link &com = robot_.link_.back();
            const Vector3d drift = robot_.B_.head(3) / robot_.total_mass_ - lift;
            return feedback(task, aim, com.xpos, com.v) - drift;
        }
        DWBC::Link &link = robot_.link_[link_index(task.link)];
        // The nonlinear effects leave the accelerations at rest behind, gravity in them.
        const Vector6d drift = RigidBodyDynamics::CalcPointAcceleration6D(
            robot_.model_, robot_.q_system_, robot_.q_dot_system_, robot_.q_ddot_system_,
            link.body_id_, task.point, false);
        const Vector3d turn = rotation_vector(task.rotation * link.rotm.transpose());
        wanted.tail(3) = task.kp * turn - task.kd * link.w - Vector3d(drift.head(3));
        if (task.kind == "pose")
        {
            const Vector3d arm = link.rotm * task.point;
            wanted.head(3) = feedback(task, aim, link.xpos + arm, link.v + link.w.cross(arm))
                             - (Vector3d(drift.tail(3)) - lift);
        }
        return wanted;
    }

    static Vector3d feedback(const Task &task, std::vector<Vector3d>::const_iterator aim,
                             const Vector3d &position, const Vector3d &velocity)
    {
        return aim[2] + task.kp * (aim[0] - position) + task.kd * (aim[1] - velocity);
    }

    const Run &run_;
    std::vector<Task> tasks_;
    std::vector<int> order_;
};

class Full : public Peer
{
public:
    Full(const std::string &urdf, const Run &run) : Peer(urdf, run, run.tasks) {}
    std::string name() const override { return "libdwbc full/osqp"; }
    int variables() const override { return robot_.system_dof_ + robot_.contact_dof_; }
    void forget() override { renew(program_); }
    // The first level is not solved: dynamics alone always have an answer.
    bool solved() const override { return solved_from(program_, 1); }
    VectorXd accelerations() const override { return program_.jacc; }
    VectorXd forces() const override { return program_.contact_force; }

private:
    void solve() override
    {
        const double begin = seconds(CLOCK_MONOTONIC);
        robot_.ConfigureLQP(program_, true);
        assembly_ = seconds(CLOCK_MONOTONIC) - begin;
        robot_.CalcControlTorqueLQP(program_, true);
    }
    VectorXd command() const override
    {
        const int joints = robot_.model_dof_;
        return robot_.A_.bottomRows(joints) * accelerations()
               + robot_.J_C.transpose().bottomRows(joints) * forces() + robot_.B_.tail(joints);
    }
    DWBC::HQP program_;
};

// The tasks of the first level and the last pose.
std::vector<Task> with_one_pose(const std::vector<Task> &tasks)
{
    std::vector<Task> kept;
    const Task *last = nullptr;
    for (const Task &task : tasks)
    {
        if (task.level == 0)
            kept.push_back(task);
        if (task.kind == "pose")
            last = &task;
    }
    if (last == nullptr)
        throw std::runtime_error("the reduced dynamics of libdwbc need the pose of a hand");
    kept.push_back(*last);
    return kept;
}

class Reduced : public Peer
{
public:
    Reduced(const std::string &urdf, const Run &run) : Peer(urdf, run, with_one_pose(run.tasks))
    {
        robot_.ts_.back().noncont_task = true;
    }
    std::string name() const override { return "libdwbc reduced/osqp"; }
    int variables() const override { return robot_.reduced_system_dof_ + robot_.contact_dof_; }
    void forget() override
    {
        renew(program_);
        renew(rest_);
    }
    bool solved() const override { return solved_from(program_, 1) && solved_from(rest_, 0); }
    VectorXd accelerations() const override
    {
        VectorXd all(robot_.system_dof_);
        all << chain().head(robot_.vc_dof), rest_.hqp_hs_.back().y_ans_;
        return all;
    }
    VectorXd forces() const override { return answer().tail(robot_.contact_dof_); }

private:
    const VectorXd &answer() const { return program_.hqp_hs_.back().y_ans_; }
    VectorXd chain() const { return answer().head(robot_.reduced_system_dof_); }
    void reduce() override { robot_.ReducedDynamicsCalculate(); }
    void solve() override
    {
        const double begin = seconds(CLOCK_MONOTONIC);
        robot_.ConfigureLQP_R(program_, true);
        const double configured = seconds(CLOCK_MONOTONIC);
        robot_.CalcControlTorqueLQP_R(program_, true);
        const double found = seconds(CLOCK_MONOTONIC);
        VectorXd accelerations = chain();
        robot_.ConfigureLQP_R_NC(rest_, accelerations, true);
        assembly_ = seconds(CLOCK_MONOTONIC) - found + configured - begin;
        robot_.CalcControlTorqueLQP_R_NC(rest_, true);
    }
    VectorXd command() const override
    {
        const int size = robot_.reduced_model_dof_, free = robot_.nc_dof;
        const VectorXd legs = robot_.A_R.bottomRows(size) * chain()
                              + robot_.J_CR.transpose().bottomRows(size) * forces()
                              + robot_.G_R.tail(size);
        VectorXd torques(robot_.model_dof_);
        torques << legs.head(robot_.co_dof),
            robot_.A_NC.bottomRightCorner(free, free) * rest_.hqp_hs_.back().y_ans_ + robot_.G_NC;
        return torques;
    }
    DWBC::HQP program_, rest_;
};

struct Answer
{
    std::ostringstream seconds, residuals, failed, torques;  // torques: of the last tick

    void add(Peer &peer, int index)
    {
        double phases[4];
        peer.forget();
        const double cpu = ::seconds(CLOCK_THREAD_CPUTIME_ID), begin = ::seconds(CLOCK_MONOTONIC);
        const VectorXd torques = peer.tick(index, phases);
        const double end = ::seconds(CLOCK_MONOTONIC);
        const double spent = ::seconds(CLOCK_THREAD_CPUTIME_ID) - cpu;
        const bool ok = peer.solved() && torques.allFinite();
        const char *comma = seconds.tellp() > 0 ? "," : "";
        seconds << comma << "[" << end - begin << "," << spent;
        for (double phase : phases)
            seconds << "," << phase;
        seconds << "]";
        if (ok)
            residuals << comma << peer.residual();
        else
            residuals << comma << "NaN";
        failed << comma << (ok ? "false" : "true");
        torques_of(peer.ordered(torques));
    }

    void torques_of(const VectorXd &ordered)
    {
        torques.str("");
        for (int i = 0; i < ordered.size(); i++)
            torques << (i ? "," : "") << ordered[i];
    }
};

void serve(Peer &peer, FILE *answers)
{
    std::string line;
    int first, count;
    while (std::getline(std::cin, line))
    {
        if (std::sscanf(line.c_str(), "{\"first\": %d, \"count\": %d}", &first, &count) != 2)
            throw std::runtime_error("cannot read a request: " + line);
        Answer answer;
        for (int i = first; i < first + count; i++)
            answer.add(peer, i);
        std::fprintf(answers,
                     "{\"seconds\": [%s], \"residuals\": [%s], \"failed\": [%s], "
                     "\"torques\": [%s], \"task_error\": %g}\n",
                     answer.seconds.str().c_str(), answer.residuals.str().c_str(),
                     answer.failed.str().c_str(), answer.torques.str().c_str(), peer.task_error());
        std::fflush(answers);
    }
}

}  // namespace

int main(int count, char **words)
{
    // The pipe is for answers only.
    FILE *answers = fdopen(dup(STDOUT_FILENO), "w");
    dup2(STDERR_FILENO, STDOUT_FILENO);
    try
    {
        if (count != 4)
            throw std::runtime_error("libdwbc_peer needs: full|reduced robot.urdf run.txt");
        const Run run = read_run(words[3]);
        std::unique_ptr<Peer> peer;
        if (std::string(words[1]) == "reduced")
            peer = std::make_unique<Reduced>(words[2], run);
        else
            peer = std::make_unique<Full>(words[2], run);
        double phases[4];
        peer->forget();
        peer->tick(0, phases);
        std::fprintf(answers, "{\"solver\": \"%s\", \"variables\": %d, \"rows\": null}\n",
                     peer->name().c_str(), peer->variables());
        std::fflush(answers);
        serve(*peer, answers);
    }
    catch (const std::exception &error)
    {
        std::fprintf(answers, "{\"error\": \"%s\"}\n", error.what());
        std::fflush(answers);
        return 1;
    }
    return 0;
}
