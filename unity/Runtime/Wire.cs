// The VRPN protocol of one TCP connection as pure functions and a state machine: no socket, no thread, no Unity.
// docs/wire-messages.md of hapticd has every layout.
using System;
using System.Collections.Generic;
using System.Text;

namespace Hapticd
{
    /// <summary>The peer violated the protocol: close the connection.</summary>
    public sealed class ProtocolException : Exception
    {
        public ProtocolException(string text) : base(text) {}
    }

    /// <summary>Writes the payload of one message: big endian, fields without alignment.</summary>
    public sealed class Payload
    {
        readonly List<byte> bytes = new List<byte>();

        public Payload I16(int value) { return Whole((ulong)(uint)value, 2); }
        public Payload I32(int value) { return Whole((ulong)(uint)value, 4); }
        public Payload U32(uint value) { return Whole(value, 4); }
        public Payload I64(long value) { return Whole((ulong)value, 8); }
        public Payload F32(float value) { return Swapped(BitConverter.GetBytes(value)); }
        public Payload F64(double value) { return Swapped(BitConverter.GetBytes(value)); }
        public Payload F64(Triple v) { return F64(v.X).F64(v.Y).F64(v.Z); }
        public Payload F64(Rotation q) { return F64(q.X).F64(q.Y).F64(q.Z).F64(q.W); }

        /// <summary>A text in a field of this size. Throws ArgumentException when it is too long; `nul`: one NUL must fit,
        /// too.</summary>
        public Payload Text(string text, int size, bool nul, string what)
        {
            byte[] utf8 = Encoding.UTF8.GetBytes(text);
            int most = nul ? size - 1 : size;
            if (utf8.Length > most)
                throw new ArgumentException(what + " '" + text + "' has " + utf8.Length + " bytes, at most " + most);
            if (Array.IndexOf(utf8, (byte)0) >= 0)
                throw new ArgumentException(what + " '" + text + "' has a NUL character");
            bytes.AddRange(utf8);
            bytes.AddRange(new byte[size - utf8.Length]);
            return this;
        }

        public byte[] ToArray() { return bytes.ToArray(); }

        Payload Whole(ulong value, int size)
        {
            for (int shift = 8 * (size - 1); shift >= 0; shift -= 8) bytes.Add((byte)(value >> shift));
            return this;
        }

        Payload Swapped(byte[] native)
        {
            if (BitConverter.IsLittleEndian) Array.Reverse(native);
            bytes.AddRange(native);
            return this;
        }
    }

    /// <summary>Reads the payload of one message. Every call throws ProtocolException behind its end.</summary>
    public sealed class PayloadReader
    {
        readonly byte[] bytes;
        readonly string message;
        readonly int end;
        int at;

        public PayloadReader(string message, byte[] bytes, int begin, int size)
        {
            this.message = message;
            this.bytes = bytes;
            at = begin;
            end = begin + size;
        }

        public int I32() { return (int)Whole(4); }
        public uint U32() { return (uint)Whole(4); }
        public long I64() { return (long)Whole(8); }
        public double F64() { return BitConverter.Int64BitsToDouble(I64()); }
        public Triple Triple() { return new Triple(F64(), F64(), F64()); }
        public Rotation Rotation() { return new Rotation(F64(), F64(), F64(), F64()); }

        /// <summary>The text in a field of this size, up to its first NUL.</summary>
        public string Text(int size)
        {
            int begin = Take(size);
            int length = 0;
            while (length < size && bytes[begin + length] != 0) ++length;
            return Encoding.UTF8.GetString(bytes, begin, length);
        }

        ulong Whole(int size)
        {
            int begin = Take(size);
            ulong value = 0;
            for (int i = 0; i < size; ++i) value = value << 8 | bytes[begin + i];
            return value;
        }

        int Take(int size)
        {
            if (size > end - at) throw new ProtocolException("a '" + message + "' message is too short");
            at += size;
            return at - size;
        }
    }

    /// <summary>Called for each message that arrives: the name of its type, and its payload.</summary>
    public delegate void MessageHandler(string type, PayloadReader payload);

    /// <summary>One side of one connection, for one device: bytes in, calls out; messages in, frames out.</summary>
    public sealed class Peer
    {
        public const int DefaultPort = 3883;
        const int HeaderBytes = 24;
        const int CookieBytes = 24;
        const int LongestFrame = 64024;
        const int MostNames = 2000;
        const int SenderDescription = -1;
        const int TypeDescription = -2;
        const int LowestType = -2000;
        const string NoDevice = "VRPN Control";  // a sender of every server

        readonly string device;
        readonly MessageHandler onMessage;
        readonly Dictionary<string, int> ourTypes = new Dictionary<string, int>();
        readonly Dictionary<int, string> theirTypes = new Dictionary<int, string>();
        readonly Dictionary<int, string> theirSenders = new Dictionary<int, string>();
        byte[] rest = new byte[0];
        volatile bool connected;
        volatile string devices = "";

        /// <summary>`types`: the names of all that will be sent.</summary>
        public Peer(string device, IEnumerable<string> types, MessageHandler onMessage)
        {
            this.device = device;
            this.onMessage = onMessage;
            foreach (string type in types) ourTypes.Add(type, ourTypes.Count);
        }

        /// <summary>The other side has said that it speaks VRPN. Any thread.</summary>
        public bool Connected { get { return connected; } }
        /// <summary>Names of its devices, as far as it described them, with commas. Any thread.</summary>
        public string Devices { get { return devices; } }

        /// <summary>What the stream begins with: our version, the device as sender 0, and the names of types.</summary>
        public byte[] Opening()
        {
            List<byte> opening = new List<byte>(Encoding.ASCII.GetBytes("vrpn: ver. 07.38  0"));
            opening.AddRange(new byte[CookieBytes - opening.Count]);
            opening.AddRange(Frame(SenderDescription, 0, Description(device)));
            foreach (KeyValuePair<string, int> type in ourTypes)
                opening.AddRange(Frame(TypeDescription, type.Value, Description(type.Key)));
            return opening.ToArray();
        }

        /// <summary>The frame of a message. Any thread.</summary>
        public byte[] Message(string type, byte[] payload) { return Frame(ourTypes[type], 0, payload); }

        /// <summary>Takes `size` bytes of the stream, cut anywhere. For one thread. Throws ProtocolException.</summary>
        public void Feed(byte[] data, int size)
        {
            byte[] all = new byte[rest.Length + size];
            rest.CopyTo(all, 0);
            Array.Copy(data, 0, all, rest.Length, size);
            int at = 0;
            if (!connected && all.Length >= CookieBytes)
            {
                string cookie = Encoding.ASCII.GetString(all, 0, CookieBytes);
                if (!cookie.StartsWith("vrpn: ver. 07.", StringComparison.Ordinal))
                    throw new ProtocolException("this is no VRPN server of version 07: it opens with '" +
                                                cookie.TrimEnd('\0') + "'");
                connected = true;
                at = CookieBytes;
            }
            while (connected && all.Length - at >= HeaderBytes)
            {
                PayloadReader header = new PayloadReader("header", all, at, HeaderBytes);
                long length = header.U32();
                if (length < HeaderBytes || length > LongestFrame)
                    throw new ProtocolException("a frame of " + length + " bytes, expected 24 to " + LongestFrame);
                int padded = ((int)length + 7) / 8 * 8;
                if (padded > all.Length - at) break;
                header.I64();  // time of sending
                int sender = header.I32();
                int type = header.I32();
                Receive(type, sender, all, at + HeaderBytes, (int)length - HeaderBytes);
                at += padded;
            }
            rest = new byte[all.Length - at];
            Array.Copy(all, at, rest, 0, rest.Length);
        }

        void Receive(int type, int sender, byte[] bytes, int begin, int size)
        {
            if (type == SenderDescription || type == TypeDescription)
            {
                if (sender < 0 || sender >= MostNames)
                    throw new ProtocolException("a description of number " + sender + ", expected 0 to " + (MostNames - 1));
                PayloadReader payload = new PayloadReader("description", bytes, begin, size);
                int length = payload.I32();
                if (length < 1) throw new ProtocolException("a description of a name of " + length + " bytes");
                string described = payload.Text(length);
                (type == SenderDescription ? theirSenders : theirTypes)[sender] = described;
                if (type == SenderDescription && described != NoDevice)
                    devices += (devices == "" ? "" : ", ") + described;
            }
            else if (type <= LowestType)
            {
                throw new ProtocolException("a message of type " + type + ", the lowest is " + (LowestType + 1));
            }
            else if (type >= 0)
            {
                string name, from;
                if (theirTypes.TryGetValue(type, out name) && theirSenders.TryGetValue(sender, out from) && from == device)
                    onMessage(name, new PayloadReader(name, bytes, begin, size));
            }
        }

        static byte[] Description(string name)
        {
            byte[] utf8 = Encoding.UTF8.GetBytes(name);
            return new Payload().I32(utf8.Length + 1).Text(name, utf8.Length + 1, true, "the name").ToArray();
        }

        static byte[] Frame(int type, int sender, byte[] payload)
        {
            int length = HeaderBytes + payload.Length;
            if (length > LongestFrame) throw new ArgumentException("a message of " + length + " bytes");
            long microseconds = (DateTime.UtcNow - new DateTime(1970, 1, 1, 0, 0, 0, DateTimeKind.Utc)).Ticks / 10;
            byte[] header = new Payload()
                                .I32(length)
                                .U32((uint)(microseconds / 1000000))
                                .U32((uint)(microseconds % 1000000))
                                .I32(sender)
                                .I32(type)
                                .U32(0)
                                .ToArray();
            byte[] frame = new byte[(length + 7) / 8 * 8];
            header.CopyTo(frame, 0);
            payload.CopyTo(frame, HeaderBytes);
            return frame;
        }
    }
}
